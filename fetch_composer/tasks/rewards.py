"""Reward and success of a goal task: pure functions of goals, of any batch shape."""

import math
from collections.abc import Sequence

import numpy as np

from fetch_composer.tasks import checks

REWARD_TYPES = ('sparse', 'dense')

DISTANCE_THRESHOLD = 0.05  # m


def goal_distance(achieved_goal, desired_goal) -> np.ndarray:
    """Returns the Euclidean distance in m, float64 of shape (...,), of goals of shape (..., 3).

    Raises:
        ValueError: if the goals are not of three numbers each, or some of them are masked.
    """
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
    x, y, z = offset[..., 0], offset[..., 1], offset[..., 2]
    return np.sqrt(x * x + y * y + z * z)  # In the order in which `distance_of_one` adds.


def _goals(name: str, value) -> np.ndarray:
    goals = checks.array(name, value)
    if not checks.is_numeric(goals):
        raise ValueError(f'{name} must be numbers, got {checks.shown(value)}.')
    if not goals.shape or goals.shape[-1] != 3:
        raise ValueError(f'{name} must be of shape (..., 3), got {goals.shape}.')
    return goals


def distance_of_one(achieved_goal: Sequence[float], desired_goal: Sequence[float]) -> float:
    """Returns `goal_distance` of two goals that are three plain floats each, to the bit."""
    (x, y, z), (u, v, w) = achieved_goal, desired_goal
    x, y, z = x - u, y - v, z - w
    return math.sqrt(x * x + y * y + z * z)


def is_success(achieved_goal, desired_goal) -> np.ndarray:
    """Returns whether goals of shape (..., 3) are closer than 0.05 m; bool, shape (...,)."""
    return goal_distance(achieved_goal, desired_goal) < DISTANCE_THRESHOLD


def reward_of_distance(distance: float, reward_type: str) -> float:
    """Returns the reward at a distance in m from the goal, of one environment."""
    if reward_type == 'dense':
        return -distance
    return 0.0 if distance < DISTANCE_THRESHOLD else -1.0


def compute_reward(achieved_goal, desired_goal, reward_type: str = 'sparse') -> np.ndarray:
    """Returns the reward of goals of shape (..., 3); float64, shape (...,).

    Args:
        achieved_goal: (..., 3) positions in m.
        desired_goal: (..., 3) positions in m.
        reward_type: 'sparse' gives 0 within 0.05 m of the goal and -1 elsewhere; 'dense' gives
            minus the distance in m.

    Raises:
        ValueError: if `reward_type` is not one of `REWARD_TYPES`, or goals are not of three numbers
            each.
    """
    checks.one_of('reward_type', reward_type, REWARD_TYPES)
    distance = goal_distance(achieved_goal, desired_goal)
    if reward_type == 'dense':
        return -distance
    return np.where(distance < DISTANCE_THRESHOLD, 0.0, -1.0)
