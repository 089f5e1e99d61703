"""Devices, their arrays, and the libraries that these cross to without a copy."""

from collections.abc import Callable, Mapping
from typing import Any

import dm_env
import numpy as np
import warp as wp

from fetch_composer.tasks import checks


def as_torch(value: Any) -> Any:
    """Returns a time step, a dict or an array with PyTorch tensors of the same memory."""
    import torch

    return _converted(value, torch.from_dlpack)


def as_jax(value: Any) -> Any:
    """Returns a time step, a dict or an array with JAX arrays of the same memory."""
    import jax

    return _converted(value, jax.dlpack.from_dlpack)


def as_numpy(value: Any) -> Any:
    """Returns a time step, a dict or an array with NumPy arrays: copies, once all is computed."""
    return _converted(value, lambda array: array.numpy().copy())


def _converted(value: Any, convert: Callable[[wp.array], Any]) -> Any:
    if isinstance(value, dm_env.TimeStep):
        return dm_env.TimeStep(*(_converted(each, convert) for each in value))
    if isinstance(value, Mapping):
        return {name: _converted(each, convert) for name, each in value.items()}
    return convert(value)


def device(name: str | None) -> wp.Device:
    """Returns a device of Warp; the first accelerator by default.

    Raises:
        ValueError: if there is no such device; the message lists those that there are.
    """
    wp.init()
    if name is None:
        return wp.get_preferred_device()
    try:
        return wp.get_device(name)
    except (ValueError, TypeError, RuntimeError):
        valid = ', '.join(map(str, wp.get_devices()))
        raise ValueError(f'Unknown device {checks.shown(name)}; valid are {valid}.') from None


def float_array(name: str, value: Any, shape: tuple[int, ...], device: wp.Device) -> wp.array:
    """Returns float32 numbers on a device.

    Args:
        name: What they are, for the message.
        value: An array of Warp, PyTorch, JAX or another library with DLPack, or numbers that NumPy
            takes.
        shape: The shape that is needed.
        device: Where they are needed; what is elsewhere is copied.

    Raises:
        ValueError: if they have another shape, or are not of float32 where nothing converts them.
    """
    if not isinstance(value, wp.array):
        is_numpy = isinstance(value, (np.ndarray, list, tuple, np.generic))
        if hasattr(value, '__dlpack__') and not is_numpy:
            value = wp.from_dlpack(_detached(value))
        else:
            value = _of_numpy(name, value, shape, device)
    if value.shape != shape:
        raise ValueError(f'{name} of shape {shape} are needed, got {value.shape}.')
    if value.dtype is not wp.float32:
        raise ValueError(
            f'{name} of float32 are needed, got {wp.types.type_repr(value.dtype)}: a device does '
            'not convert them.'
        )
    return value if value.device == device else value.to(device)


def _detached(value: Any) -> Any:
    return value.detach() if hasattr(value, 'detach') else value


def _of_numpy(name: str, value: Any, shape: tuple[int, ...], device: wp.Device) -> wp.array:
    found = checks.array(name, value)
    if not checks.is_numeric(found):
        raise ValueError(f'{name} must be numbers, got {checks.shown(value)}.')
    if found.shape != shape:
        raise ValueError(f'{name} of shape {shape} are needed, got {found.shape}.')
    return wp.array(found, dtype=float, device=device)
