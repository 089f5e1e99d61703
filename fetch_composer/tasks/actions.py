"""What an action is: a displacement of the gripper, and the opening of its fingers."""

import numpy as np
from dm_env import specs

ACTION_SIZE = 4
METRES_PER_UNIT = 0.05  # Displacement that an action of 1 asks for.

# What the peer adds to the gripper's quaternion to get the mocap body's.
ADDED_ROTATION = np.array((1.0, 0.0, 1.0, 0.0))

SPEC = specs.BoundedArray(
    shape=(ACTION_SIZE,), dtype=np.float32, minimum=-1, maximum=1, name='dx\tdy\tdz\tgripper'
)


def clip(action, batch_shape: tuple[int, ...] = ()) -> np.ndarray:
    """Returns the action with each component clipped to [-1, 1], in its own precision.

    The precision matters: the peer scales a float32 action in float32.

    Args:
        action: (*batch_shape, 4) displacement of the gripper along x, y and z in units of
            0.05 m, and the opening of its fingers.
        batch_shape: () for one action.

    Raises:
        ValueError: if it has another shape or is not finite.
    """
    array = np.asarray(action)
    shape = (*batch_shape, ACTION_SIZE)
    if array.shape != shape:
        raise ValueError(f'An action of shape {shape} is needed, got {array.shape}.')
    if array.dtype.kind not in 'fiu':
        raise ValueError(f'An action of floats is needed, got dtype {array.dtype}.')
    if not np.isfinite(array).all():
        if batch_shape:
            rows = np.flatnonzero(~np.isfinite(array).all(axis=-1)).tolist()
            raise ValueError(f'Actions must be finite; rows {rows} are not.')
        raise ValueError(f'An action must be finite, got {array.tolist()}.')
    return array.clip(-1, 1)
