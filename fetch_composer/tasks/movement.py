"""Whether an episode moves what it is about."""

import numpy as np

_MOVED = 0.005  # m from the start, along an axis; touches by accident move an object less.


def has_moved(achieved_goals: np.ndarray) -> np.ndarray:
    """Returns whether what achieves goals gets away from where it starts; bool, shape (...,).

    Args:
        achieved_goals: (..., steps, 3 n) positions in m.
    """
    way = achieved_goals - achieved_goals[..., :1, :]
    return np.abs(way).max(axis=(-2, -1)) > _MOVED
