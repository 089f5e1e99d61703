"""What is as true elsewhere: transitions mirrored left to right, and moved along the table.

The robot is symmetric, and a push is the same push wherever on the table it is made; networks that
see each transition in many places need not learn that from experience (Lin et al., "Invariant
Transform Experience Replay", 2020, mirror at planes that are drawn).
"""

import numpy as np

from fetch_composer.learning import networks
from fetch_composer.tasks import layout

_X, _Y = slice(0, 1), slice(1, 2)
_X_AND_Z = slice(0, 3, 2)


class Mirror:
    """Swaps left and right in observations, goals and actions."""

    def __init__(self, observation_size: int, plane: float) -> None:
        """Initializes the mirror.

        Args:
            observation_size: Length of an observation.
            plane: y in m of the plane at which it mirrors.
        """
        indices = np.arange(observation_size)
        self._order = indices.copy()
        self._sign = np.ones(observation_size, np.float32)
        self._offset = np.zeros(observation_size, np.float32)
        for at in layout.of_size(observation_size):
            for position in (at.grip_position, at.object_position):
                self._offset[indices[position][_Y]] = 2 * plane
            ways = (at.relative_position, at.grip_velocity, at.object_velocity)
            for vector in (at.grip_position, at.object_position, *ways):
                self._sign[indices[vector][_Y]] = -1
            for turn in (at.object_rotation, at.object_spin):
                self._sign[indices[turn][_X_AND_Z]] = -1
            for fingers in (at.fingers, at.finger_velocities):
                self._order[fingers] = indices[fingers][::-1]
        goal = networks.achieved_goal_indices(observation_size)
        self._goal_sign, self._goal_offset = self._sign[goal], self._offset[goal]
        self._action_sign = np.ones(networks.ACTION_SIZE, np.float32)
        self._action_sign[_Y] = -1

    def observation(self, observation: np.ndarray) -> np.ndarray:
        """Returns (..., size) mirrored observations."""
        return (self._sign * observation + self._offset)[..., self._order]

    def goal(self, goal: np.ndarray) -> np.ndarray:
        """Returns (..., goal_size) mirrored goals."""
        return self._goal_sign * goal + self._goal_offset

    def action(self, action: np.ndarray) -> np.ndarray:
        """Returns (..., 4) mirrored actions."""
        return self._action_sign * action


class Shift:
    """Moves observations and goals along the table."""

    def __init__(self, observation_size: int) -> None:
        """Initializes the shift of observations of this length."""
        indices = np.arange(observation_size)
        positions = [
            indices[position]
            for at in layout.of_size(observation_size)
            for position in (at.grip_position, at.object_position)
        ]
        self._x = np.unique(np.concatenate([each[_X] for each in positions]))
        self._y = np.unique(np.concatenate([each[_Y] for each in positions]))

    def observation(self, observation: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Returns (n, size) observations moved by (n, 2) m along x and y."""
        moved = observation.copy()
        moved[:, self._x] += by[:, _X]
        moved[:, self._y] += by[:, _Y]
        return moved

    def goal(self, goal: np.ndarray, by: np.ndarray) -> np.ndarray:
        """Returns (n, goal_size) goals moved by (n, 2) m along x and y."""
        moved = goal.copy()
        moved[:, 0::3] += by[:, _X]
        moved[:, 1::3] += by[:, _Y]
        return moved
