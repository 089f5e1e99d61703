"""A scripted expert for Reach: go straight to the goal, and stay there."""

from collections.abc import Mapping

import numpy as np

_METRES_PER_UNIT = 0.05  # Displacement that an action of 1 asks for.
_GAIN = 1.5  # The weld is soft: the gripper moves about two thirds of what is asked for.


class ReachExpert:
    """Closes the distance to the goal in every step; keeps nothing from one to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Reach in either convention."""
        way = observation['desired_goal'] - observation['achieved_goal']
        # One factor for all three axes, so that the way is straight however long it is.
        units = way * _GAIN / _METRES_PER_UNIT
        units /= max(1.0, np.abs(units).max())
        return np.array([*units, 0.0], dtype=np.float32)
