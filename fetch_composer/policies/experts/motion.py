"""How an action moves the gripper, for the experts that plan in metres."""

import numpy as np
from numpy.typing import ArrayLike

from fetch_composer.tasks.action_modes import METRES_PER_UNIT

# The weld is soft: in one control step the gripper moves two thirds of what is asked for.
_GAIN = 1.5

FURTHEST = METRES_PER_UNIT / _GAIN  # m along an axis that the gripper moves in one control step.


def move(way: ArrayLike, fingers: float = 0.0) -> np.ndarray:
    """Returns the action that moves the gripper in one control step, or as far as it can.

    Args:
        way: (3,) displacement in m; each component is cut off at `FURTHEST`.
        fingers: Fourth component of the action: 1 opens, -1 closes.

    Returns:
        (4,) float32 in [-1, 1].
    """
    return np.clip([*np.divide(way, FURTHEST), fingers], -1, 1).astype(np.float32)
