"""A scripted expert for Push two: push one block after the other, each around the other.

It reads positions only, and so needs no reward type.
"""

from collections.abc import Mapping

import numpy as np

from fetch_composer.policies.experts import motion
from fetch_composer.policies.experts.detour import Obstacle
from fetch_composer.policies.experts.push import push
from fetch_composer.tasks import layout, tabletop

_PLACES = layout.of(2)
_BLOCK_HALF_SIZE = np.array(tabletop.BLOCK_HALF_SIZE[:2])  # m


class PushTwoExpert:
    """Pushes both blocks to their goals; keeps nothing from one step to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Push two."""
        seen = observation['observation']
        blocks = [seen[at.object_position][:2] for at in _PLACES]
        goals = observation['desired_goal'].reshape(-1, 3)[:, :2]
        for block, goal, other in zip(blocks, goals, blocks[::-1], strict=True):
            obstacle = Obstacle(other, _BLOCK_HALF_SIZE)
            action = push(seen[_PLACES[0].grip_position], block, goal, (obstacle,))
            if action is not None:
                return action
        return motion.move(np.zeros(3))
