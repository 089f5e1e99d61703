"""Runs a policy on a Fetch task without a display and writes down what happened.

The same as `python -m fetch_composer.explorer`, from a clone; `python explore.py --help` lists the
flags.
"""

import pathlib
import runpy
import sys

_GL = pathlib.Path(__file__).parent / 'fetch_composer' / 'explorer' / 'gl.py'

if __name__ == '__main__':
    # By its path, since importing it would import dm_control, which reads what is chosen here.
    runpy.run_path(str(_GL))['choose']()

    from fetch_composer.explorer.__main__ import main

    sys.exit(main())
