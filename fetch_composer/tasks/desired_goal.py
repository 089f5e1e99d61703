"""The goal of the present episode: how far it is, what that earns, and the marks that show it."""

import mujoco
import numpy as np
import numpy.typing as npt
from dm_env import specs

from fetch_composer.entities import ACHIEVED_RGBA
from fetch_composer.tasks import rewards
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.observation import GoalObserver


class DesiredGoal:
    """The desired goal of one simulation, with a target at each of its places."""

    def __init__(self, count: int, reward_type: str) -> None:
        """Initializes a goal that no episode has set.

        Args:
            count: How many places there are, of three numbers each.
            reward_type: One of `rewards.REWARD_TYPES`.
        """
        self._position: np.ndarray = np.zeros(3 * count)
        self._reward_type = reward_type

    def compile(self, model: mujoco.MjModel, addresses: Addresses, observer: GoalObserver) -> None:
        """Finds the targets in the compiled model, and what there is to achieve the goal with."""
        self._target_positions, self._targets = model.body_pos, addresses.targets
        self._rgba, self._sites = model.site_rgba, addresses.target_sites
        self._usual_rgba = model.site_rgba[addresses.target_sites]
        self._achieved = observer.achieved

    @property
    def position(self) -> np.ndarray:
        """(3 n,) in m; a copy."""
        return self._position.copy()

    def set(self, position: npt.ArrayLike) -> None:
        """Sets the goal, (3 n,) in m, and puts the targets there."""
        self._position = np.array(position, dtype=np.float64)
        self._target_positions[self._targets] = self._position.reshape(-1, 3)

    def show(self, achieved: bool) -> None:
        """Colours the targets as ones whose goal is achieved, or is not."""
        self._rgba[self._sites] = ACHIEVED_RGBA if achieved else self._usual_rgba

    def is_achieved(self) -> bool:
        """Returns whether everything is less than 0.05 m from its place now."""
        distance = rewards.distance_of_one(self._achieved(), self._position.tolist())
        return distance < rewards.DISTANCE_THRESHOLD

    def reward(self) -> float:
        """Returns the reward of the present state."""
        return rewards.reward_of_one(self._achieved(), self._position.tolist(), self._reward_type)

    def reward_spec(self) -> specs.Array:
        """Returns the reward's spec."""
        if self._reward_type == 'sparse':
            return specs.BoundedArray((), np.float64, minimum=-1, maximum=0, name='reward')
        # Without the bound of -inf, which `generate_value` would return.
        return specs.Array((), np.float64, name='reward')
