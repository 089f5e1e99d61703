"""A scripted expert for Reach: go to the goal, and stay there."""

from collections.abc import Mapping

import numpy as np

from fetch_composer.policies.experts import motion


class ReachExpert:
    """Closes the distance to the goal in every step; keeps nothing from one to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Reach in either convention."""
        return motion.move(observation['desired_goal'] - observation['achieved_goal'])
