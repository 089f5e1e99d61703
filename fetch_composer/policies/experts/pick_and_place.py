"""A scripted expert for Pick-and-Place: get above the block, grasp it, hold it at its goal.

It reads positions only, and so needs neither the convention nor the reward type.
"""

from collections.abc import Mapping

import numpy as np

from fetch_composer.policies.experts import motion
from fetch_composer.tasks.layout import WITH_OBJECT as AT

# Height of the observed grip site above the block's centre, in m, at which the fingers pass over
# the block: the fingertips are 0.0185 m below the site, the block's top is 0.025 m above its
# centre.
HOVER = 0.06

_LOWEST = 0.42  # Height in m of the grip site, lower than which the fingertips meet the table.

ABOVE = 0.02  # So near to the block's axis, in m, the open fingers can go down around it ...
AROUND = 0.012  # ... and so near to its centre they can close.
HELD = 0.03  # A block this near to closed fingers is between them: it may slip a little.

# Displacements of a finger in m, of at most 0.05; at 0.024 it touches the block.
OPEN = 0.04
CLOSED = 0.03

OPENING, CLOSING = 1.0, -1.0  # Fourth component of an action.


class PickAndPlaceExpert:
    """Grasps the block and holds it at its goal; keeps nothing from one step to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation in either convention."""
        seen = observation['observation']
        gripper, block = seen[AT.grip_position], seen[AT.object_position]
        fingers = seen[AT.fingers]
        to_block = (*block[:2], max(block[2], _LOWEST)) - gripper
        distance = np.linalg.norm(to_block)

        if distance < HELD and fingers.max() < CLOSED:
            return motion.move(observation['desired_goal'] - block, CLOSING)
        if distance < AROUND:
            return motion.move(to_block, CLOSING)
        if np.linalg.norm(to_block[:2]) < ABOVE and fingers.min() > OPEN:
            return motion.move(to_block, OPENING)
        return motion.move(to_block + (0.0, 0.0, HOVER), OPENING)
