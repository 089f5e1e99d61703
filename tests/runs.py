"""How tests drive the explorer: as a user does, in a process of its own."""

import json
import os
import pathlib
import subprocess
import sys

from fetch_composer.explorer import flags as flags_lib

ROOT = pathlib.Path(__file__).parent.parent
EXPLORE = str(ROOT / 'explore.py')

EPISODES = 2
STEPS = 9
SEED = 7
SMALL = ('--width=96', '--height=64')
PLAIN_FILES = {'progress.png', 'report.html', 'summary.json', 'trajectories.npz'}
SECONDS_TO_START = 60


def environment(**variables):
    """Returns the environment of a user who has set these variables and has no display."""
    unset = ('MUJOCO_GL', 'PYOPENGL_PLATFORM', 'DISPLAY')
    inherited = {name: value for name, value in os.environ.items() if name not in unset}
    return {**inherited, 'PYTHONPATH': str(ROOT), **variables}


def explore(*flags, **variables):
    """Returns what `explore.py` did with these flags and variables."""
    return subprocess.run(
        [sys.executable, EXPLORE, *flags],
        env=environment(**variables),
        capture_output=True,
        text=True,
    )


def check_imports_none_of(statement, needless):
    """Makes sure that a statement, in a process of its own, imports none of these modules."""
    code = (
        f'import sys\n{statement}\nneedless = {set(needless)!r}\n'
        'assert not needless & set(sys.modules), needless & set(sys.modules)'
    )
    subprocess.run([sys.executable, '-c', code], env=environment(MUJOCO_GL='off'), check=True)


def names(folder):
    """Returns the names of the files in a folder."""
    return {path.name for path in folder.iterdir()}


def summary(folder):
    """Returns what is in the summary of a run."""
    return json.loads((folder / 'summary.json').read_text())


def options(**changes):
    """Returns the options of a small run."""
    small = {'policy': ['zero'], 'episodes': 1, 'max_episode_steps': 3, 'width': 96, 'height': 64}
    return flags_lib.make_options({**small, **changes})
