"""Values that are refused with a message that says what would be valid."""

import contextlib
import numbers
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

_LONGEST_SHOWN = 200


def shown(value: Any) -> str:
    """Returns how a message shows a value, whatever it is."""
    try:
        text = repr(value)
    except Exception:  # An integer of thousands of digits has none, nor what the user has broken.
        text = f'a {type(value).__name__}'
    return text if len(text) <= _LONGEST_SHOWN else f'{text[:_LONGEST_SHOWN]}...'


def one_of(name: str, value: Any, valid: Iterable[str]) -> None:
    """Raises `ValueError`, which lists the valid names, if a value is not one of them."""
    valid = tuple(valid)
    if not isinstance(value, str) or value not in valid:
        raise ValueError(f'Unknown {name} {shown(value)}; valid are {", ".join(valid)}.')


def boolean(name: str, value: Any) -> bool:
    """Returns a Boolean: a Python or NumPy one.

    Raises:
        ValueError: if it is something else.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f'{name} must be True or False; got {shown(value)}.')
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
    is_other = _is_boolean(value) or getattr(value, 'dtype', None) == np.bool_
    if not is_other and not np.ma.is_masked(value):
        with contextlib.suppress(Exception):  # Of what has no index, or hides it.
            number = value.__index__()
    if number is None or number < least:
        kind = {0: 'non-negative', 1: 'positive'}[least]
        otherwise = f', or {otherwise}' if otherwise else ''
        raise ValueError(f'{name} must be a {kind} integer{otherwise}; got {shown(value)}.')
    return number


def positive(name: str, value: Any, unit: str) -> float:
    """Returns a positive finite number as a float.

    Raises:
        ValueError: if it is something else.
    """
    if isinstance(value, numbers.Real) and not _is_boolean(value) and 0 < float(value) < np.inf:
        return float(value)
    raise ValueError(f'{name} must be a positive number of {unit}, got {shown(value)}.')


def array(name: str, value: Any, booleans: bool = False) -> np.ndarray:
    """Returns a value as an array of its own type, which nothing in it is hidden from.

    Args:
        name: What it is, for the message.
        value: The value.
        booleans: Whether there may be Booleans in it; else those in a list would pass as numbers.

    Raises:
        ValueError: if values in it are masked, or it has no shape.
    """
    if type(value) is np.ndarray:
        return value
    if _any_in(value, np.ma.is_masked):
        raise ValueError(f'{name} has masked values: {shown(value)}. Fill them first.')
    if not booleans and isinstance(value, (list, tuple)) and _any_in(value, _is_boolean):
        raise ValueError(f'{name} must be numbers; got {shown(value)}.')
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f'{name} is no array: {shown(value)} ({error}).') from None


def sequence(name: str, value: Any) -> list:
    """Returns a list of what is in a sequence, an array or a range.

    Raises:
        ValueError: if it is none; a single text is none either.
    """
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise ValueError(f'{name} must be a sequence; got {shown(value)}.')
    return list(value)


def mapping(name: str, value: Any) -> None:
    """Raises `ValueError` if a value is no mapping."""
    if not isinstance(value, Mapping):
        raise ValueError(f'{name} must be a mapping by name; got {shown(value)}.')


def is_numeric(value: np.ndarray) -> bool:
    """Returns whether an array is of real numbers."""
    return value.dtype.kind in 'fiu'


def _is_boolean(value: Any) -> bool:
    return isinstance(value, (bool, np.bool_))


def _any_in(value: Any, test: Callable[[Any], bool]) -> bool:
    """Returns whether a value, or one in it if it is a list, passes a test."""
    if isinstance(value, (list, tuple)):
        return any(_any_in(each, test) for each in value)
    return test(value)


def _numbers(name: str, value: Any) -> np.ndarray:
    """Returns numbers as an array; a NaN of no dimension for what is not made of numbers."""
    found = array(name, value)
    return found.astype(np.float64) if is_numeric(found) else np.array(np.nan)


def finite(name: str, value: Any, shape: tuple[int, ...]) -> None:
    """Raises `ValueError` if a value is not an array of finite numbers of a shape."""
    # What it is nearly always, first: states are restored thousands of times by planners.
    is_floats = type(value) is np.ndarray and value.dtype == np.float64
    found = value if is_floats else _numbers(name, value)
    if found.shape != shape or not np.isfinite(found).all():
        raise ValueError(f'{name} must be finite numbers of shape {shape}; got {shown(value)}.')


def place(name: str, value: Any, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Returns a place, (2,) or (3,) in m, as an array.

    Raises:
        ValueError: if it is not as many finite numbers as `lower` has, between it and `upper`.
    """
    found = _numbers(name, value)
    if found.shape != lower.shape or not np.all(np.isfinite(found)):
        raise ValueError(f'{name} must be {lower.size} finite numbers in m, got {shown(value)}.')
    if np.any(found < lower) or np.any(found > upper):
        raise ValueError(
            f'{name} {found.tolist()} is off the table: it must lie between '
            f'{lower.round(4).tolist()} and {upper.round(4).tolist()} m.'
        )
    return found


def sizes(name: str, value: Any, count: int, smallest: float, largest: float) -> tuple[float, ...]:
    """Returns `count` sizes, or one for all, in m.

    Raises:
        ValueError: if they are something else, or not between the smallest and the largest.
    """
    found = _numbers(name, value)
    with np.errstate(invalid='ignore'):
        is_valid = found.shape in ((), (1,), (count,)) and bool(
            ((found >= smallest) & (found <= largest)).all()
        )
    if not is_valid:
        raise ValueError(
            f'{name} must be {count} numbers, or one for all, from {smallest} to {largest} m; got '
            f'{shown(value)}.'
        )
    return tuple(found.reshape(-1).tolist())


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
    found = _numbers(name, values)
    if found.shape not in ((size,), (count, size)):
        raise ValueError(
            f'{name} must be numbers of shape ({size},) or ({count}, {size}), got {shown(values)}.'
        )
    return list(np.broadcast_to(found, (count, size)))


def _is_mask(value: np.ndarray, count: int) -> bool:
    return value.shape == (count,) and value.dtype == bool


def mask(name: str, value: Any, count: int) -> None:
    """Raises `ValueError` if a value is not a mask of shape (count,)."""
    if not _is_mask(array(name, value, booleans=True), count):
        raise ValueError(f'{name} must be {count} booleans; got {shown(value)}.')


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
    found = array('ids', value, booleans=True)
    if _is_mask(found, count):
        return np.flatnonzero(found)
    valid = found.ndim == 1 and (found.dtype.kind in 'iu' or not found.size)
    if valid and found.size:
        valid = found.min() >= 0 and found.max() < count and len(np.unique(found)) == len(found)
    if not valid:
        raise ValueError(
            f'ids must be distinct integers from 0 to {count - 1}, or a mask of {count} '
            f'booleans; got {shown(value)}.'
        )
    return found.astype(np.int64)
