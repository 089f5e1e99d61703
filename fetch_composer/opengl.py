"""Imports dm_control, and says what is wrong with MUJOCO_GL if that is why it cannot be imported.

dm_control itself shows where in its code the fault occurs, and, of a backend that is not installed,
nothing else.
"""

import os
import warnings

try:
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # GLFW's, where there is no display.
        import dm_control.mujoco  # noqa: F401
except Exception as error:
    if not os.environ.get('MUJOCO_GL'):
        raise
    # With this name, `python -m` tells of it in one line.
    raise ImportError(
        f'MUJOCO_GL={os.environ["MUJOCO_GL"]} does not work here; valid are egl, osmesa and glfw, '
        'each where it is installed, and disabled, with which nothing is drawn.',
        name='fetch_composer',
    ) from error
