"""The ways to act: what the numbers of an action ask for.

An action is an array of floats in [-1, 1]. Its last number opens (+) and closes (-) the fingers in
every mode; the ones before it move the gripper, or the joints of the arm.
"""

import dataclasses
import functools

import numpy as np
from dm_env import specs

from fetch_composer.entities import ARM_JOINTS
from fetch_composer.tasks import checks

METRES_PER_UNIT = 0.05  # Displacement of the gripper that a 1 asks for.
RADIANS_PER_UNIT = 0.1  # Rotation of the gripper that a 1 asks for.
# Of a joint's target. In a control step it is 1.25 rad/s, which each of the real robot can do.
JOINT_RADIANS_PER_UNIT = 0.05

_DISPLACEMENT = ('dx', 'dy', 'dz')
_ROTATION = ('rx', 'ry', 'rz')
_GRIPPER = 'gripper'


@dataclasses.dataclass(frozen=True)
class ActionMode:
    """One way to act.

    Attributes:
        name: As passed to `load`.
        displacement: Names of the numbers that displace the gripper.
        rotation: Names of the numbers that turn it: the last components of a rotation vector in
            global coordinates.
        joints: Names of the numbers that move the targets of the arm's joints. If there are any,
            position servos move the arm, and no mocap body does.
    """

    name: str
    displacement: tuple[str, ...] = _DISPLACEMENT
    rotation: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()

    @functools.cached_property
    def components(self) -> tuple[str, ...]:
        """The names of an action's numbers, in their order."""
        return (*self.displacement, *self.rotation, *self.joints, _GRIPPER)

    @functools.cached_property
    def shape(self) -> tuple[int]:
        """The shape of an action."""
        return (len(self.components),)

    @functools.cached_property
    def spec(self) -> specs.BoundedArray:
        """The spec of an action."""
        return specs.BoundedArray(
            shape=self.shape,
            dtype=np.float32,
            minimum=-1,
            maximum=1,
            name='\t'.join(self.components),
        )

    def clip(self, action, batch_shape: tuple[int, ...] = ()) -> np.ndarray:
        """Returns the action with each component clipped to [-1, 1], in its own precision.

        The precision matters: Gymnasium-Robotics scales a float32 action in float32.

        Args:
            action: (*batch_shape, n) as `components` names its numbers.
            batch_shape: () for one action.

        Raises:
            ValueError: if it has another shape, is not finite, or has values that are masked.
        """
        array = action if type(action) is np.ndarray else checks.array('An action', action)
        if array.shape == self.shape and not batch_shape and array.dtype.kind in 'fiu':
            # For so few numbers, plain floats are faster than any function of arrays.
            for value in array.tolist():
                if not -1 <= value <= 1:
                    break
            else:
                return array
        shape = (*batch_shape, *self.shape)
        if array.shape != shape:
            raise ValueError(
                f'An action of shape {shape} is needed, got {array.shape}; '
                f'its numbers are {", ".join(self.components)}.'
            )
        if not checks.is_numeric(array):
            raise ValueError(f'An action of floats is needed, got dtype {array.dtype}.')
        if not np.isfinite(array).all():
            if batch_shape:
                rows = np.flatnonzero(~np.isfinite(array).all(axis=-1)).tolist()
                raise ValueError(f'Actions must be finite; rows {rows} are not.')
            raise ValueError(f'An action must be finite, got {array.tolist()}.')
        return array.clip(-1, 1)


DISPLACEMENT = ActionMode('displacement')

MODES = {
    mode.name: mode
    for mode in (
        DISPLACEMENT,
        ActionMode('displacement+yaw', rotation=('yaw',)),
        ActionMode('displacement+rotation', rotation=_ROTATION),
        ActionMode(
            'joints',
            displacement=(),
            joints=tuple(name.removesuffix('_joint') for name in ARM_JOINTS),
        ),
    )
}
