"""The control law: what an action does to the gripper, and how a start is put in place.

It is written for arrays of shape (...,), of which () is one simulation and (n,) are many.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from dm_env import specs

from fetch_composer.tasks import checks, conventions
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.starts import StartState

ACTION_SIZE = 4
METRES_PER_UNIT = 0.05  # Displacement that an action of 1 asks for.

# What Gymnasium-Robotics adds to the gripper's quaternion to get the mocap body's.
_ADDED_ROTATION = np.array((1.0, 0.0, 1.0, 0.0))
_FIXED_ROTATION = np.array(conventions.POINTING_DOWN)

_SHAPE_OF_ONE = (ACTION_SIZE,)

ACTION_SPEC = specs.BoundedArray(
    shape=(ACTION_SIZE,), dtype=np.float32, minimum=-1, maximum=1, name='dx\tdy\tdz\tgripper'
)


def clip(action, batch_shape: tuple[int, ...] = ()) -> np.ndarray:
    """Returns the action with each component clipped to [-1, 1], in its own precision.

    The precision matters: Gymnasium-Robotics scales a float32 action in float32.

    Args:
        action: (*batch_shape, 4) displacement of the gripper along x, y and z in units of
            0.05 m, and the opening of its fingers.
        batch_shape: () for one action.

    Raises:
        ValueError: if it has another shape, is not finite, or has values that are masked.
    """
    array = action if type(action) is np.ndarray else checks.array('An action', action)
    if array.shape == _SHAPE_OF_ONE and not batch_shape and array.dtype.kind in 'fiu':
        # For four numbers, plain floats are faster than any function of arrays.
        a, b, c, d = array.tolist()
        if -1 <= a <= 1 and -1 <= b <= 1 and -1 <= c <= 1 and -1 <= d <= 1:
            return array
    shape = (*batch_shape, ACTION_SIZE)
    if array.shape != shape:
        raise ValueError(f'An action of shape {shape} is needed, got {array.shape}.')
    if not checks.is_numeric(array):
        raise ValueError(f'An action of floats is needed, got dtype {array.dtype}.')
    if not np.isfinite(array).all():
        if batch_shape:
            rows = np.flatnonzero(~np.isfinite(array).all(axis=-1)).tolist()
            raise ValueError(f'Actions must be finite; rows {rows} are not.')
        raise ValueError(f'An action must be finite, got {array.tolist()}.')
    return array.clip(-1, 1)


def refresh(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Brings positions and velocities, which `mj_step` leaves one substep behind, up to date."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)


def fall_behind(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Puts positions and velocities one substep behind the state, where `mj_step` leaves them."""
    qpos = data.qpos.copy()
    mujoco.mj_integratePos(model, data.qpos, data.qvel, -model.opt.timestep)
    refresh(model, data)
    data.qpos[:] = qpos


class Drive:
    """Moves the gripper of one simulation, or of many at once."""

    def __init__(
        self,
        bind: Callable[[str], np.ndarray],
        addresses: Addresses,
        convention: conventions.Convention,
        locked_gripper: bool,
    ) -> None:
        """Looks up the arrays that it reads and writes.

        Args:
            bind: Returns a live array of MuJoCo's data by name, (..., size): () for one
                simulation and (n,) for many.
            addresses: Where things are in them.
            convention: Decides on the gripper's rotation and on what a locked gripper is.
            locked_gripper: Whether the gripper stays closed.
        """
        self._additive_rotation = convention.additive_rotation
        self._locked_gripper = locked_gripper
        # Fingers that slide within a control step, and are put back at its end.
        self.loose_fingers = locked_gripper and not convention.rigid_lock
        # Whether observations are those of the state, or of one substep earlier.
        self.observes_current_state = locked_gripper or convention.refresh_unlocked
        self._qpos, self._qvel, self._control = bind('qpos'), bind('qvel'), bind('ctrl')
        self._fingers = self._qpos[..., addresses.finger_qpos]
        self._mocap_position = bind('mocap_pos')[..., addresses.mocap, :]
        self._mocap_quaternion = bind('mocap_quat')[..., addresses.mocap, :]
        self._gripper_position = bind('xpos')[..., addresses.gripper_link, :]
        self._gripper_quaternion = bind('xquat')[..., addresses.gripper_link, :]
        # Poses of a restored state that do not follow from its physics, NaN where there is none.
        self._restored: np.ndarray | None = None

    def place(self, state: StartState, rows: Any = ...) -> None:
        """Puts a start in place.

        Args:
            state: The start.
            rows: An index of the simulations to write to; ... for all.
        """
        self._qpos[rows] = state.qpos
        self._qvel[rows] = state.qvel
        self._mocap_position[rows] = state.mocap_position
        self._mocap_quaternion[rows] = state.mocap_quaternion
        self._forget_restored(rows)

    def gripper_pose(self, rows: Any = ...) -> np.ndarray:
        """Returns (..., 7) position in m and quaternion from which an action moves the gripper."""
        pose = np.concatenate(
            (self._gripper_position[rows], self._gripper_quaternion[rows]), axis=-1
        )
        if self._restored is None:
            return pose
        restored = self._restored[rows]
        return np.where(np.isnan(restored), pose, restored)

    def set_gripper_pose(self, pose: np.ndarray, rows: Any = ...) -> None:
        """Sets what `gripper_pose` returns, until the physics advances."""
        if self.observes_current_state:
            return  # It follows from the state, to the bit.
        if self._restored is None:
            self._restored = np.full((*self._gripper_position.shape[:-1], 7), np.nan)
        self._restored[rows] = pose

    def _forget_restored(self, rows: Any) -> None:
        if self._restored is not None:
            self._restored[rows] = np.nan
            if np.isnan(self._restored).all():
                self._restored = None

    def act(self, action: np.ndarray, rows: Any = ...) -> None:
        """Asks for what an action asks for, before the physics advances.

        Args:
            action: (..., 4) clipped actions of those simulations.
            rows: An index of the simulations to write to; ... for all.
        """
        displacement = action[..., :3] * METRES_PER_UNIT
        position, quaternion = self._gripper_position, self._gripper_quaternion
        if self._restored is not None:
            pose = self.gripper_pose()
            position, quaternion = pose[..., :3], pose[..., 3:]
            self._forget_restored(rows)
        if rows is ...:
            np.add(position, displacement, out=self._mocap_position)
        else:
            self._mocap_position[rows] = position[rows] + displacement
        if self._additive_rotation:
            self._mocap_quaternion[rows] = quaternion[rows] + _ADDED_ROTATION
        else:
            self._mocap_quaternion[rows] = _FIXED_ROTATION
        if not self._locked_gripper:
            self._control[rows] = self._fingers[rows] + action[..., 3:]

    def relock(self, rows: Any = ...) -> None:
        """Puts loose fingers back, after the physics has advanced."""
        if self.loose_fingers:
            self._fingers[rows] = 0
