"""Runs a policy on a Fetch task without a display and writes down what happened.

Per run one page, report.html, and beside it films, a contact sheet, a plot of distance and return
over time, the trajectories and a summary. A run that was stopped or killed is continued by the same
command. Run `python explore.py --help` for the flags.
"""

import dataclasses
import os
import signal
import subprocess
import sys
import tempfile
import typing
from collections.abc import Sequence

from absl import app, flags, logging

if typing.TYPE_CHECKING:
    from fetch_composer.explorer import run as run_lib
    from fetch_composer.explorer.results import writing

flags.DEFINE_string('task', 'push', 'Task to run: push, reach, slide or pick_and_place.')
flags.DEFINE_multi_string(
    'policy',
    ['expert'],
    'Who acts: expert, random, zero, PATH.onnx, PATH.zip of Stable-Baselines3, or module:function; '
    'given several times, to compare them.',
)
flags.DEFINE_bool(
    'trust_pickle', False, 'Read a Stable-Baselines3 zip, which can run code as it is read.'
)
flags.DEFINE_integer('episodes', 5, 'Number of episodes.')
flags.DEFINE_integer('seed', 0, 'Seed of the first episode; each has the next one.')
flags.DEFINE_string(
    'convention', 'documented', 'Reading of the task: documented or gymnasium_robotics.'
)
flags.DEFINE_string('reward_type', 'sparse', 'Reward: sparse or dense.')
flags.DEFINE_integer('max_episode_steps', 50, 'Control steps of an episode, 25 to a second.')
flags.DEFINE_integer(
    'num_envs', 64, 'Episodes that run at a time, on all processors; it changes none of them.'
)
flags.DEFINE_string('films', 'worst', 'Episodes to film: worst, best, first, all or none.')
flags.DEFINE_integer('num_films', 5, 'How many episodes to film of the worst, best or first.')
flags.DEFINE_string('camera', 'corner', 'Where to film from: corner, front, side, top, close, ...')
flags.DEFINE_integer(
    'width', 480, 'Width of the film in pixels; without a GPU, 480x360 costs about 0.1 s a frame.'
)
flags.DEFINE_integer('height', 360, 'Height of the film in pixels.')
flags.DEFINE_integer('fps', 25, 'Frames per second of the film; 25 is real time.')
flags.DEFINE_string('output_dir', None, 'Folder to write into; by default output/<task>_<policy>.')
flags.DEFINE_string(
    'ray', None, 'Ray cluster to run the episodes on: its address, or local for this machine.'
)
flags.DEFINE_string('dataset', None, 'Minari dataset to write the episodes to: [namespace/]name-v0')
flags.DEFINE_bool('fresh', False, 'Discard an unfinished run in the folder, do not continue it.')

_GL_VARIABLE = 'MUJOCO_GL'
_BACKENDS = ('egl', 'osmesa', 'glfw')  # The last needs a display; macOS has no other.
_NO_BACKEND = 'disabled'
_NO_BACKEND_SYNONYMS = ('off', 'disable', 'disabled', 'false', '0')
_GL_PROBE = """
from dm_control import mujoco
physics = mujoco.Physics.from_xml_string('<mujoco/>')
physics.render(16, 16)
physics.free()
"""
_GL_PROBE_SECONDS = 60
_GL_ADVICE = (
    'For pictures, install one: `apt-get install libegl1 libgl1-mesa-dri` (EGL) or '
    '`apt-get install libosmesa6` (OSMesa).'
)

_SIGNALLED = 128  # Plus the signal's number: what a shell reports of a stopped process.


def main(argv: list[str]) -> int:
    logging.set_verbosity(logging.WARNING)
    if len(argv) > 1:
        return _fail(f'unexpected argument {argv[1]!r}; all options are flags, see --help.')
    try:
        return _explore()
    except KeyboardInterrupt:
        print('\nInterrupted: no file was left half-written.', file=sys.stderr)
        return _SIGNALLED + signal.SIGINT


def _explore() -> int:
    backend = _choose_gl_backend()
    # dm_control and MuJoCo read this once, when they are imported.
    os.environ[_GL_VARIABLE] = backend or _NO_BACKEND
    try:
        from fetch_composer.explorer import run as run_lib
    except ModuleNotFoundError as error:
        return _fail(f"{error.name} is not installed: pip install 'fetch_composer[explore]'")

    options = run_lib.Options(**_flag_values(run_lib.Options))
    try:
        run = run_lib.Run(options, backend, fresh=flags.FLAGS.fresh)
    except (ImportError, ValueError, RuntimeError) as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(f'Cannot write into --output_dir {options.folder}: {error.strerror}.')
    try:
        written = run.run()
    except OSError as error:
        return _fail(f'Writing into {options.folder} failed: {error}')
    except (ValueError, RuntimeError) as error:
        return _fail(str(error))
    finally:
        run.close()
    _report(run, written)
    return _SIGNALLED + run.stopped_by if run.stopped_by else 0


def _flag_values(options_class) -> dict[str, typing.Any]:
    return {
        field.name: flags.FLAGS[field.name].value for field in dataclasses.fields(options_class)
    }


def _report(run: 'run_lib.Run', written: Sequence['writing.Written']) -> None:
    if run.continued:
        print(f'Continued: {run.continued} episodes were there already.')
    if run.stopped_by:
        print(f'Stopped by {run.stopped_by.name} after {run.finished} episodes.')
    if not run.finished:
        print('No episode was finished; nothing was written.')
        return
    if run.stopped_by:
        print('The same command continues.')
    print('\n'.join(run.results))
    print(f'Open, in {run.options.folder}:')
    for each in written:
        names = each.names[0] if len(each.names) == 1 else f'{each.names[0]} ... {each.names[-1]}'
        print(f'  {names:<36} {each.content}')


def _choose_gl_backend() -> str | None:
    """Returns the OpenGL backend to take pictures with, or None, which is explained, for none."""
    chosen = os.environ.get(_GL_VARIABLE) or None
    if chosen in _NO_BACKEND_SYNONYMS:
        print(f'No pictures: {_GL_VARIABLE}={chosen}.')
        return None
    candidates = _BACKENDS if chosen is None else (chosen,)
    for backend in candidates:
        if _draws(backend):
            return backend
    if chosen is None:
        print(f'No pictures: no OpenGL backend works here (tried {", ".join(candidates)}).')
    else:
        print(f'No pictures: {_GL_VARIABLE}={chosen} is set, and does not work here.')
    print(_GL_ADVICE)
    return None


def _draws(backend: str) -> bool:
    """Returns whether a picture can be drawn; in another process, as MuJoCo chooses only once."""
    try:
        with tempfile.TemporaryDirectory() as folder:  # For the log that MuJoCo leaves.
            probe = subprocess.run(
                [sys.executable, '-c', _GL_PROBE],
                env={**os.environ, _GL_VARIABLE: backend},
                cwd=folder,
                capture_output=True,
                timeout=_GL_PROBE_SECONDS,
            )
    except subprocess.TimeoutExpired:
        return False
    return probe.returncode == 0


def _fail(message: str) -> int:
    print(f'explore.py: error: {message}', file=sys.stderr)
    return 1


if __name__ == '__main__':
    app.run(main)
