"""Reward and success of a goal task: pure functions of goals, of any batch shape."""

import functools
import math
from collections.abc import Sequence

import numpy as np

from fetch_composer.tasks import checks

REWARD_TYPES = ('sparse', 'dense')

DISTANCE_THRESHOLD = 0.05  # m

_AXES = 3  # Numbers of a goal for each object.


def goal_distance(achieved_goal, desired_goal) -> np.ndarray:
    """Returns the distance in m, float64 of shape (...,), of goals of shape (..., 3 n).

    With several objects it is that of the one that is furthest from its goal.

    Raises:
        ValueError: if the goals are not of three numbers for each object, or some are masked.
    """
    squares = _squared_distances(achieved_goal, desired_goal)
    return np.sqrt(functools.reduce(np.maximum, squares))


def _squared_distances(achieved_goal, desired_goal) -> list[np.ndarray]:
    """Returns the squared distance, (...,) in m², of each object."""
    achieved, desired = (
        _goals('achieved_goal', achieved_goal), _goals('desired_goal', desired_goal)
    )  # fmt: skip
    try:
        offset = np.subtract(achieved, desired, dtype=np.float64)
    except ValueError:
        raise ValueError(
            f'achieved_goal and desired_goal must be of one shape, got {achieved.shape} and '
            f'{desired.shape}.'
        ) from None
    squares = []
    for i in range(0, offset.shape[-1], _AXES):
        x, y, z = offset[..., i], offset[..., i + 1], offset[..., i + 2]
        squares.append(x * x + y * y + z * z)  # In the order in which `_squared` adds.
    return squares


def _goals(name: str, value) -> np.ndarray:
    goals = checks.array(name, value)
    if not checks.is_numeric(goals):
        raise ValueError(f'{name} must be numbers, got {checks.shown(value)}.')
    if not goals.shape or not goals.shape[-1] or goals.shape[-1] % _AXES:
        raise ValueError(
            f'{name} must be of shape (..., 3), or (..., 3 n) for n objects; got {goals.shape}.'
        )
    return goals


def _squared(achieved: Sequence[float], desired: Sequence[float]) -> list[float]:
    """Returns the squared distance of each object, from plain floats."""
    if len(achieved) == _AXES:  # For so few numbers, unpacking is faster than any slice.
        (x, y, z), (u, v, w) = achieved, desired
        x, y, z = x - u, y - v, z - w
        return [x * x + y * y + z * z]
    each = range(0, len(achieved), _AXES)
    return [_squared(achieved[i : i + _AXES], desired[i : i + _AXES])[0] for i in each]


def distance_of_one(achieved_goal: Sequence[float], desired_goal: Sequence[float]) -> float:
    """Returns `goal_distance` of two goals that are plain floats, to the bit."""
    return math.sqrt(max(_squared(achieved_goal, desired_goal)))


def reward_of_one(
    achieved_goal: Sequence[float], desired_goal: Sequence[float], reward_type: str
) -> float:
    """Returns `compute_reward` of two goals that are plain floats, to the bit."""
    squares = _squared(achieved_goal, desired_goal)
    if reward_type == 'dense':
        return -math.sqrt(sum(squares))
    return 0.0 if math.sqrt(max(squares)) < DISTANCE_THRESHOLD else -1.0


def is_success(achieved_goal, desired_goal) -> np.ndarray:
    """Returns whether each object is closer than 0.05 m to its goal; bool, shape (...,)."""
    return goal_distance(achieved_goal, desired_goal) < DISTANCE_THRESHOLD


def compute_reward(achieved_goal, desired_goal, reward_type: str = 'sparse') -> np.ndarray:
    """Returns the reward of goals of shape (..., 3 n), for n objects; float64, shape (...,).

    Args:
        achieved_goal: (..., 3 n) positions in m.
        desired_goal: (..., 3 n) positions in m.
        reward_type: 'sparse' gives 0 if every object is within 0.05 m of its goal, and else -1;
            'dense' gives minus the norm of the whole difference in m: for one object, minus its
            distance.

    Raises:
        ValueError: if `reward_type` is not one of `REWARD_TYPES`, or goals are not of three numbers
            for each object.
    """
    checks.one_of('reward_type', reward_type, REWARD_TYPES)
    if reward_type == 'dense':
        return -np.sqrt(functools.reduce(np.add, _squared_distances(achieved_goal, desired_goal)))
    return np.where(is_success(achieved_goal, desired_goal), 0.0, -1.0)
