"""A scripted expert for Push: get behind the block, push it to its goal, leave it there.

It reads positions only, and so needs neither the convention nor the reward type.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from fetch_composer.policies.experts import detour, motion
from fetch_composer.policies.experts.detour import Obstacle
from fetch_composer.tasks.layout import WITH_OBJECT as AT

# Heights of the observed grip site in m. The fingertips are 0.0185 m below it, the block's top
# is at 0.45 and the table's surface at 0.4.
_PUSHING_HEIGHT = 0.425
_TRAVEL_HEIGHT = 0.49
_RISING = 0.437  # Above this they are on their way up or down.
_LOW = 0.45  # Below this the fingers are beside the block, and can push it ...
_HIGH = 0.475  # ... and above this they are over it.

# Distances in m, in the plane of the table.
_BEHIND = 0.065  # From the block's centre to the place where a push begins.
_CLEARANCE = 0.055  # Low fingers this near to the block's centre may touch it ...
_BREAK_AWAY = 0.075  # ... and this near they would drag it along as they rise.
_LANDING = 0.045  # Among obstacles, a gripper goes down no further than this from its place.
_FINGERS = 0.025  # Low fingers this near to an obstacle may touch it.
_TOUCHING = 0.02  # A gripper that is not this far behind the block's centre cannot push it.
_IN_LINE = 0.03  # A gripper further than this beside the line to the goal pushes askew.
_HOME = 0.015  # From block to goal, where a push ends ...
_CLOSE_ENOUGH = 0.04  # ... and where going around the block for another is not worth it.

# A push, in m per control step. Faster, the block tips and glides on past its goal.
_FASTEST = 0.033
_SLOWEST = 0.004
_BRAKING = 0.25  # Per step, this share of what is left to the goal.
_LOOKAHEAD = 0.04  # A gripper that is this far beside the line returns to it at 45 degrees.


class PushExpert:
    """Pushes the block to its goal; keeps nothing from one step to the next."""

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Push in either convention."""
        gripper = observation['observation'][AT.grip_position]
        block = observation['observation'][AT.object_position][:2]
        action = push(gripper, block, observation['desired_goal'][:2])
        return motion.move(np.zeros(3)) if action is None else action


def push(
    gripper: np.ndarray,
    block: np.ndarray,
    goal: np.ndarray,
    obstacles: Sequence[Obstacle] = (),
) -> np.ndarray | None:
    """Returns the action, (4,) float32, that brings a block nearer to its goal; None at the goal.

    Args:
        gripper: (3,) position of the gripper in m.
        block: (2,) x and y of the block in m.
        goal: (2,) x and y in m.
        obstacles: What else stands on the table, which block and gripper go around or over.
    """
    way_there = detour.first_leg(block, goal, obstacles) - block
    to_goal = goal - block
    left = np.linalg.norm(to_goal)
    distance = np.linalg.norm(way_there)
    ahead = way_there / max(distance, _SLOWEST)

    from_block = gripper[:2] - block
    along = from_block @ ahead
    beside = from_block - along * ahead
    ready = gripper[2] < _LOW and along < -_TOUCHING and np.linalg.norm(beside) < _IN_LINE

    if left < (_HOME if ready else _CLOSE_ENOUGH):
        return None
    if ready:
        speed = min(_SLOWEST + _BRAKING * left, _FASTEST)
        return motion.move((*(speed * (ahead - beside / _LOOKAHEAD)), _PUSHING_HEIGHT - gripper[2]))
    return _go_to(-_BEHIND * ahead, gripper, block, obstacles)


def _go_to(
    place: np.ndarray, gripper: np.ndarray, block: np.ndarray, obstacles: Sequence[Obstacle]
) -> np.ndarray:
    """Returns the action that brings the gripper to a place beside the block.

    Args:
        place: (2,) where to go, from the block's centre, in m.
        gripper: (3,) where the gripper is, in m.
        block: (2,) x and y of the block's centre in m.
        obstacles: What else stands on the table.
    """
    from_block, height = gripper[:2] - block, gripper[2]
    way = place - from_block
    meets = any(each.meets(gripper[:2], block + place, _FINGERS) for each in obstacles)
    # Among obstacles: else a rise that has brought it clear would end at once, and begin again.
    stays_high = bool(obstacles) and height > _RISING and np.linalg.norm(way) > _LANDING
    if not (meets or stays_high or _passes_block(from_block, way)):
        return motion.move((*way, _PUSHING_HEIGHT - height))
    if height < _HIGH and np.linalg.norm(from_block) < _BREAK_AWAY:
        way = from_block
    elif height < _HIGH and meets:
        way = np.zeros(2)
    return motion.move((*way, _TRAVEL_HEIGHT - height))


def _passes_block(from_block: np.ndarray, way: np.ndarray) -> bool:
    """Returns whether the straight way of a low gripper leads too near to the block."""
    share_of_way = np.clip(-from_block @ way / max(way @ way, 1e-9), 0, 1)
    nearest = from_block + share_of_way * way
    return bool(np.linalg.norm(nearest) < _CLEARANCE)
