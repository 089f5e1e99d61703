"""A scripted expert for Push around: push the block past the nearer end of the wall.

It reads positions only, and so needs no reward type.
"""

from collections.abc import Mapping

import numpy as np

from fetch_composer.policies.experts import motion
from fetch_composer.policies.experts.detour import Obstacle
from fetch_composer.policies.experts.push import push
from fetch_composer.tasks import push_around
from fetch_composer.tasks.layout import WITH_OBJECT as AT

_WALL = Obstacle(np.array(push_around.WALL_CENTRE), np.array(push_around.WALL_HALF_SIZE[:2]))


class PushAroundExpert:
    """Pushes the block around the wall; keeps nothing from one step to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Push around."""
        gripper = observation['observation'][AT.grip_position]
        block = observation['observation'][AT.object_position][:2]
        action = push(gripper, block, observation['desired_goal'][:2], (_WALL,))
        return motion.move(np.zeros(3)) if action is None else action
