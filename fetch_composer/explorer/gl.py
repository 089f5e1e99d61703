"""Which OpenGL backend takes the pictures.

They are drawn in a process of their own (see `pictures.drawing`), and this one loads no OpenGL.
dm_control reads MUJOCO_GL and loads a backend when it is imported, so that it is told before. This
module imports nothing of the package: `explore.py` runs it by its path. In
`python -m fetch_composer.explorer` the package comes first, and the process starts again.
"""

import os
import subprocess
import sys
import tempfile
from typing import NoReturn

_VARIABLE = 'MUJOCO_GL'
# Says to the process that starts again, and to it alone, that the backend has been found.
_FOUND_VARIABLE = 'FETCH_COMPOSER_FOUND_GL'
_BACKENDS = ('egl', 'osmesa', 'glfw')  # The last needs a display; macOS has no other.
_OTHERS = ('on', 'enable', 'enabled', 'true', '1')  # Which dm_control takes for the last, too.
_DISABLED = 'disabled'
_DISABLED_SYNONYMS = ('off', 'disable', 'disabled', 'false', '0')
_PROBE = """
from dm_control import mujoco
physics = mujoco.Physics.from_xml_string('<mujoco/>')
physics.render(16, 16)
physics.free()
"""
_PROBE_SECONDS = 60
_ADVICE = (
    'For pictures, install one:\n'
    '  `apt-get install libegl1 libgl1-mesa-dri` (EGL) or\n'
    '  `apt-get install libosmesa6` (OSMesa).'
)


def choose() -> bool:
    """Finds a backend that works, or explains why none does, and keeps OpenGL out of this process.

    Returns:
        Whether MUJOCO_GL has changed, so that a process that has imported dm_control must start
        again.

    Raises:
        SystemExit: if MUJOCO_GL names no backend; the message lists those that there are.
    """
    before = os.environ.get(_VARIABLE)
    if before == _DISABLED and _FOUND_VARIABLE in os.environ:
        return False
    os.environ[_FOUND_VARIABLE] = _find() or _DISABLED
    os.environ[_VARIABLE] = _DISABLED
    return before != _DISABLED


def chosen() -> str | None:
    """Returns the backend that `choose` has found, or None for no pictures; ask once."""
    found = os.environ.pop(_FOUND_VARIABLE, _DISABLED)
    return None if found == _DISABLED else found


def start_again() -> NoReturn:
    """Runs the command of this process anew, in its place and with its environment variables."""
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _find() -> str | None:
    """Returns a backend to take pictures with, or None, which is explained, for none."""
    wanted = os.environ.get(_VARIABLE) or None
    if wanted in _DISABLED_SYNONYMS:
        _say(f'No pictures: {_VARIABLE}={wanted}.')
        return None
    if wanted is not None and wanted not in _BACKENDS + _OTHERS:
        sys.exit(
            f'{os.path.basename(sys.argv[0])}: error: {_VARIABLE}={wanted} is set; valid are '
            f'{", ".join(_BACKENDS)}, and {_DISABLED} for no pictures. Unset, one that works is '
            'chosen.'
        )
    candidates = _BACKENDS if wanted is None else (wanted,)
    for backend in candidates:
        if _draws(backend):
            return backend
    if wanted is None:
        _say(f'No pictures: no OpenGL backend works here (tried {", ".join(candidates)}).')
    else:
        _say(f'No pictures: {_VARIABLE}={wanted} is set, and does not work here.')
    _say(_ADVICE)
    return None


def _say(message: str) -> None:
    print(message, file=sys.stderr)


def _draws(backend: str) -> bool:
    """Returns whether a picture can be drawn; in another process, as MuJoCo chooses only once."""
    try:
        with tempfile.TemporaryDirectory() as folder:  # For the log that MuJoCo leaves.
            probe = subprocess.run(
                [sys.executable, '-c', _PROBE],
                env={**os.environ, _VARIABLE: backend},
                cwd=folder,
                capture_output=True,
                timeout=_PROBE_SECONDS,
            )
    except subprocess.TimeoutExpired:
        return False
    return probe.returncode == 0
