"""How observations are joined into one vector, for networks that take one."""

from collections.abc import Mapping

import numpy as np

_OBSERVATION, _ACHIEVED, _DESIRED = 'observation', 'achieved_goal', 'desired_goal'

JOINED = (_OBSERVATION, _DESIRED)  # Where a network leaves it open.
# A width tells which is meant: 25, 28 or 31 numbers with an object, and 10, 13 or 16 without.
_LAYOUTS = (
    (_OBSERVATION,),
    JOINED,
    (_ACHIEVED, _DESIRED, _OBSERVATION),  # As Gymnasium's FlattenObservation sorts them.
)


def layout(width: int, sizes: Mapping[str, int]) -> tuple[str, ...] | None:
    """Returns the names of the observations that make a vector, in their order.

    Args:
        width: How many numbers the vector has.
        sizes: How many each observation has, by name.

    Returns:
        The names; None if no vector of that width is known.
    """
    found = (each for each in _LAYOUTS if _width(each, sizes) == width)
    return next(found, None)


def valid_layouts(sizes: Mapping[str, int]) -> str:
    """Returns the vectors that are known, for a message."""
    return ', '.join(f'{_width(each, sizes)} ({", ".join(each)})' for each in _LAYOUTS)


def joined(
    observations: Mapping[str, np.ndarray], names: tuple[str, ...], dtype: type
) -> np.ndarray:
    """Returns observations, (n, size) each, side by side as (n, width)."""
    return np.concatenate([observations[name] for name in names], axis=-1).astype(dtype)


def _width(names: tuple[str, ...], sizes: Mapping[str, int]) -> int:
    return sum(sizes[name] for name in names)
