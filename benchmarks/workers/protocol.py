"""How a worker is told to measure: a line in asks for one round, a line out is its result."""

import json
import os
import sys
from collections.abc import Callable

READY = 'READY'


def serve(build: Callable[..., Callable[[], object]]) -> None:
    """Builds what is to be measured, says so, and measures one round for every line read.

    Ends with its input. Whatever else the process prints goes to standard error.

    Args:
        build: Called with the options that are given as JSON in the first argument. Returns a
            function that measures one round and returns something that JSON can express.
    """
    results = os.fdopen(os.dup(sys.stdout.fileno()), 'w')
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    measure = build(**json.loads(sys.argv[1]))
    print(READY, file=results, flush=True)
    for _ in sys.stdin:
        print(json.dumps(measure()), file=results, flush=True)
