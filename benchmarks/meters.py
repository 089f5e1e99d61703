"""What can be measured: work within a process that stays alive, or a process as a whole."""

import contextlib
import dataclasses
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from benchmarks.workers import protocol

ROOT = pathlib.Path(__file__).resolve().parent.parent

OWN = 'own'
RAY = 'ray'  # Ours as well, where that is installed.

# Nothing is rendered, and nobody is to pay for looking for a display.
_ENVIRONMENT = {**os.environ, 'MUJOCO_GL': 'disabled'}


class WorkerError(RuntimeError):
    """A worker did not answer; the message has the end of what it printed."""


class Interpreters:
    """The Python in which each package is installed."""

    def __init__(self, peers: Mapping[str, str | None] | None = None) -> None:
        """Initializes the interpreters.

        Args:
            peers: {name: path of its Python, or None where there is none}.
        """
        has_ray = importlib.util.find_spec('ray') is not None
        own = {OWN: sys.executable, RAY: sys.executable if has_ray else None}
        self._paths = {**(peers or {}), **own}

    def missing(self, name: str) -> bool:
        """Returns whether that package's Python is not there."""
        path = self._paths.get(name)
        return path is None or not os.access(path, os.X_OK)

    def path(self, name: str) -> str:
        """Returns the path of that package's Python."""
        path = self._paths[name]
        assert path is not None, name
        return os.path.abspath(path)


class Meter(Protocol):
    """One side of a comparison.

    Attributes:
        label: What is measured.
        interpreter: Name of the package whose Python runs it.
    """

    @property
    def label(self) -> str: ...

    @property
    def interpreter(self) -> str: ...

    def opened(
        self, interpreters: Interpreters
    ) -> contextlib.AbstractContextManager[Callable[[], Any]]:
        """Returns a context that gives a function, which measures one round."""


@contextlib.contextmanager
def _worker(python: str, module: str, options: Mapping[str, Any]) -> Iterator[Callable[[], Any]]:
    """Starts a worker (see `workers.protocol`), ends it, and gives what measures one round."""
    command = [python, '-m', f'benchmarks.workers.{module}', json.dumps(options)]
    with tempfile.TemporaryFile('w+') as errors:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=_ENVIRONMENT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        assert process.stdin is not None and process.stdout is not None

        def answer() -> str:
            line = process.stdout.readline().strip()  # type: ignore[union-attr]
            if not line:
                errors.seek(0)
                raise WorkerError(f'{module} {dict(options)} ended:\n{errors.read()[-2000:]}')
            return line

        def measure() -> Any:
            process.stdin.write('\n')  # type: ignore[union-attr]
            process.stdin.flush()  # type: ignore[union-attr]
            return json.loads(answer())

        try:
            if (line := answer()) != protocol.READY:
                raise WorkerError(f'{module} said {line!r} instead of {protocol.READY!r}.')
            yield measure
        finally:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
            process.stdout.close()
            process.wait()


@dataclasses.dataclass(frozen=True)
class Worker:
    """Seconds that a control step, or another operation, takes in a process that stays alive.

    Attributes:
        label: What is measured.
        interpreter: Name of the package whose Python runs it.
        module: Module of `benchmarks.workers`.
        options: What it is given.
    """

    label: str
    interpreter: str
    module: str
    options: Mapping[str, Any]

    @contextlib.contextmanager
    def opened(self, interpreters: Interpreters) -> Iterator[Callable[[], Any]]:
        """Gives a function that measures one round."""
        with _worker(interpreters.path(self.interpreter), self.module, self.options) as measure:
            yield measure


@dataclasses.dataclass(frozen=True)
class WholeProcess:
    """Seconds from the start of a process to its end.

    Attributes:
        label: What is measured.
        interpreter: Name of the package whose Python runs it.
        code: What the process does.
    """

    label: str
    interpreter: str
    code: str

    @contextlib.contextmanager
    def opened(self, interpreters: Interpreters) -> Iterator[Callable[[], float]]:
        """Gives a function that measures one run."""
        command = [interpreters.path(self.interpreter), '-c', self.code]

        def measure() -> float:
            begin = time.perf_counter()
            run = subprocess.run(command, cwd=ROOT, env=_ENVIRONMENT, text=True,
                                 capture_output=True)  # fmt: skip
            seconds = time.perf_counter() - begin
            if run.returncode:
                raise WorkerError(f'{self.code!r} failed:\n{run.stderr[-2000:]}')
            return seconds

        yield measure


@dataclasses.dataclass(frozen=True)
class MemoryPerEnvironment:
    """Bytes of resident memory by which a process grows with each environment.

    Attributes:
        label: What is measured.
        interpreter: Name of the package whose Python runs it.
        kind: What `workers.memory` is to build.
        counts: How many environments, in one process and in another.
    """

    label: str
    interpreter: str
    kind: str
    counts: tuple[int, int]

    @contextlib.contextmanager
    def opened(self, interpreters: Interpreters) -> Iterator[Callable[[], float]]:
        """Gives a function that measures two new processes."""

        def resident(count: int) -> int:
            options = {'kind': self.kind, 'count': count}
            path = interpreters.path(self.interpreter)
            with _worker(path, 'memory', options) as measure:
                return measure()

        def measure() -> float:
            few, many = self.counts
            return (resident(many) - resident(few)) / (many - few)

        yield measure
