"""Values that are refused with a message that says what would be valid."""

import contextlib
from collections.abc import Iterable
from typing import Any

import numpy as np


def one_of(name: str, value: Any, valid: Iterable[str]) -> None:
    """Raises `ValueError`, which lists the valid names, if a value is not one of them."""
    valid = tuple(valid)
    if not isinstance(value, str) or value not in valid:
        raise ValueError(f'Unknown {name} {value!r}; valid are {", ".join(valid)}.')


def boolean(name: str, value: Any) -> bool:
    """Returns a Boolean: a Python or NumPy one.

    Raises:
        ValueError: if it is something else.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f'{name} must be True or False; got {value!r}.')
    return bool(value)


def integer(name: str, value: Any, least: int, otherwise: str = '') -> int:
    """Returns an integer: a Python or NumPy one, or an array of no dimension.

    Args:
        name: What it is, for the message.
        value: The value.
        least: The smallest that is valid, 0 or 1.
        otherwise: What else would be valid, for the message.

    Raises:
        ValueError: if it is something else, or too small.
    """
    number = None
    if not isinstance(value, (bool, np.bool_)) and getattr(value, 'dtype', None) != np.bool_:
        with contextlib.suppress(AttributeError, TypeError):
            number = value.__index__()
    if number is None or number < least:
        kind = {0: 'non-negative', 1: 'positive'}[least]
        otherwise = f', or {otherwise}' if otherwise else ''
        raise ValueError(f'{name} must be a {kind} integer{otherwise}; got {value!r}.')
    return number


def _numbers(value: Any) -> np.ndarray:
    """Returns numbers as an array; a NaN of no dimension for what is not made of numbers."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)


def place(name: str, value: Any, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Returns a place, (2,) or (3,) in m, as an array.

    Raises:
        ValueError: if it is not as many finite numbers as `lower` has, between it and `upper`.
    """
    array = _numbers(value)
    if array.shape != lower.shape or not np.all(np.isfinite(array)):
        raise ValueError(f'{name} must be {lower.size} finite numbers in m, got {value!r}.')
    if np.any(array < lower) or np.any(array > upper):
        raise ValueError(
            f'{name} {array.tolist()} is off the table: it must lie between '
            f'{lower.round(4).tolist()} and {upper.round(4).tolist()} m.'
        )
    return array


def places(name: str, values: Any, count: int, size: int) -> list[np.ndarray | None]:
    """Returns one place, or None, for each of `count` environments.

    Args:
        name: What they are, for the message.
        values: (size,) one for all, (count, size) one for each, or None.
        count: How many environments there are.
        size: How many numbers a place has.

    Raises:
        ValueError: if they have another shape, or are not numbers.
    """
    if values is None:
        return [None] * count
    array = _numbers(values)
    if array.shape not in ((size,), (count, size)):
        raise ValueError(
            f'{name} must be numbers of shape ({size},) or ({count}, {size}), got {values!r}.'
        )
    return list(np.broadcast_to(array, (count, size)))


def ids(value: Any, count: int) -> np.ndarray:
    """Returns indices of environments, in the order in which they are given.

    Args:
        value: Distinct integers, a mask of shape (count,), or None for all.
        count: How many environments there are.

    Raises:
        ValueError: if it is something else.
    """
    if value is None:
        return np.arange(count)
    array = np.asarray(value)
    if array.shape == (count,) and array.dtype == bool:
        return np.flatnonzero(array)
    valid = array.ndim == 1 and (array.dtype.kind in 'iu' or not array.size)
    if valid and array.size:
        valid = array.min() >= 0 and array.max() < count and len(np.unique(array)) == len(array)
    if not valid:
        raise ValueError(
            f'ids must be distinct integers from 0 to {count - 1}, or a mask of {count} '
            f'booleans; got {value!r}.'
        )
    return array.astype(np.int64)
