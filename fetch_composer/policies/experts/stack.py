"""A scripted expert for Stack: put the lower block down at its goal, then the upper one on top.

It reads positions only, and so needs no reward type. What comes next shows in them: a block that
lies where it belongs is done with, and one between closed fingers is being carried.
"""

from collections.abc import Mapping

import numpy as np

from fetch_composer.policies.experts import motion
from fetch_composer.policies.experts.pick_and_place import (
    ABOVE,
    AROUND,
    CLOSED,
    CLOSING,
    HELD,
    HOVER,
    OPEN,
    OPENING,
)
from fetch_composer.tasks import layout

_LOWER, _UPPER = layout.of(2)
_ON_TOP = np.array((0.0, 0.0, 0.05))  # m from the lower block's centre to the upper one's.

_CARRYING = 0.03  # A carried block's bottom is this many m above the top of one on the table.
_STACKED = 0.02  # A block this near to its place in the plane has been put there ...
_LYING = 0.008  # ... if it is no higher above it than this.
_OVER = 0.006  # A carried block this near to its place, in the plane, is let down.


class StackExpert:
    """Puts one block on the other; keeps nothing from one step to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Stack."""
        seen = observation['observation']
        gripper, fingers = seen[_LOWER.grip_position], seen[_LOWER.fingers]
        lower, upper = seen[_LOWER.object_position], seen[_UPPER.object_position]
        goal = observation['desired_goal'][:3]
        lies_at_goal = _lies_at(lower, goal)
        block, place = (upper, lower + _ON_TOP) if lies_at_goal else (lower, goal)
        if lies_at_goal and (_lies_at(upper, place) or np.linalg.norm(lower - gripper) < HELD):
            return _let_go(gripper, fingers, place)
        return _bring(block, place, gripper, fingers)


def _lies_at(block: np.ndarray, place: np.ndarray) -> bool:
    offset = block - place
    return bool(np.linalg.norm(offset[:2]) < _STACKED and abs(offset[2]) < _LYING)


def _let_go(gripper: np.ndarray, fingers: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Returns the action that opens the fingers and, once they are open, rises above a place."""
    if fingers.min() < OPEN:
        return motion.move(np.zeros(3), OPENING)
    return motion.move((0.0, 0.0, place[2] + HOVER - gripper[2]), OPENING)


def _bring(
    block: np.ndarray, place: np.ndarray, gripper: np.ndarray, fingers: np.ndarray
) -> np.ndarray:
    """Returns the action that grasps a block, or carries it nearer to its place.

    Args:
        block: (3,) centre of the block in m.
        place: (3,) where its centre is to be in m.
        gripper: (3,) where the gripper is in m.
        fingers: (2,) displacements of the fingers in m.
    """
    to_block, to_place = block - gripper, place - block
    distance = np.linalg.norm(to_block)
    if distance < HELD and fingers.max() < CLOSED:
        if np.abs(to_place[:2]).max() > _OVER:
            to_place[2] += _CARRYING
            if to_place[2] > _OVER:
                to_place[:2] = 0.0  # Up first.
        return motion.move(to_place, CLOSING)
    if distance < AROUND:
        return motion.move(to_block, CLOSING)
    if np.linalg.norm(to_block[:2]) < ABOVE and fingers.min() > OPEN:
        return motion.move(to_block, OPENING)
    return motion.move(to_block + (0.0, 0.0, HOVER), OPENING)
