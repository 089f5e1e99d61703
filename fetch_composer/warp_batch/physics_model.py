"""The model as MuJoCo Warp has it, and what makes its physics MuJoCo's.

Each choice was found by comparing contacts and accelerations of the two in the same states.
"""

import contextlib
from collections.abc import Iterator

import mujoco
import mujoco_warp as mjw

# Where MuJoCo has 1e-6, which is too fine for single precision: contacts of a cylinder were missed.
_CCD_TOLERANCE = 3e-5  # m


def put(model: mujoco.MjModel) -> mjw.Model:
    """Returns a model on the current device; `model` stays as it is."""
    with _changed_options(model.opt):
        made = mjw.put_model(model)
    # MuJoCo Warp makes constraints after it has looked for contacts, from velocities of the substep
    # before. Else the gripper strays from MuJoCo's by 5e-5 m within 20 control steps, and not by
    # 1e-6, and what follows a state depends on what came before it.
    made.callback.contactfilter = mjw.com_vel
    made.opt.warn_overflow = 0  # `Simulation.take_faults` tells.
    return made


@contextlib.contextmanager
def _changed_options(options: mujoco.MjOption) -> Iterator[None]:
    flags, tolerance = options.disableflags, options.ccd_tolerance
    # For two boxes, the general algorithm has fewer contacts than MuJoCo if they are tilted by a
    # few degrees. With this flag, boxes have MuJoCo's own.
    options.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    options.ccd_tolerance = _CCD_TOLERANCE
    try:
        yield
    finally:
        options.disableflags, options.ccd_tolerance = flags, tolerance
