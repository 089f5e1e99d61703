"""The control law: what an action does to the arm, and how a start is put in place.

It is written for arrays of shape (...,), of which () is one simulation and (n,) are many.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from fetch_composer.tasks import conventions, rotations
from fetch_composer.tasks.action_modes import (
    JOINT_RADIANS_PER_UNIT,
    METRES_PER_UNIT,
    RADIANS_PER_UNIT,
)
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.options import TaskOptions
from fetch_composer.tasks.starts import StartState

# What Gymnasium-Robotics adds to the gripper's quaternion to get the mocap body's.
ADDED_ROTATION = np.array((1.0, 0.0, 1.0, 0.0))
FIXED_ROTATION = np.array(conventions.POINTING_DOWN)

# How far ahead of the gripper and of a joint their targets may be. At full speed, the one follows
# 0.06 to 0.15 rad behind and the other 0.2.
_FURTHEST_ROTATION = 0.3  # rad
_FURTHEST_TARGET = 0.25  # rad

_SAME_POSE = 1e-9  # m


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
    """Moves the arm of one simulation, or of many at once."""

    def __init__(
        self,
        bind: Callable[[str], np.ndarray],
        addresses: Addresses,
        options: TaskOptions,
        locked_gripper: bool,
    ) -> None:
        """Looks up the arrays that it reads and writes.

        Args:
            bind: Returns a live array of MuJoCo's data by name, (..., size): () for one
                simulation and (n,) for many.
            addresses: Where things are in them.
            options: Their convention decides on the gripper's rotation and on what a locked
                gripper is, and their action mode on what an action moves.
            locked_gripper: Whether the gripper stays closed.
        """
        convention, mode = conventions.CONVENTIONS[options.convention], options.mode
        self.clip = mode.clip
        self._moves_joints, self._turns_gripper = bool(mode.joints), bool(mode.rotation)
        self._additive_rotation = convention.additive_rotation
        self._locked_gripper = locked_gripper
        # Fingers that slide within a control step, and are put back at its end.
        self.loose_fingers = locked_gripper and not convention.rigid_lock
        # Whether observations are those of the state, or of one substep earlier.
        self.observes_current_state = locked_gripper or convention.refresh_unlocked
        self._qpos, self._qvel = bind('qpos'), bind('qvel')
        self._fingers = self._qpos[..., addresses.finger_qpos]
        self._finger_control = bind('ctrl')[..., addresses.finger_control]
        self._arm_qpos, self._targets = addresses.arm_qpos, bind('ctrl')[..., addresses.arm_control]
        self._lowest_target, self._highest_target = addresses.arm_control_range.T
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
        if self._moves_joints:
            self._targets[rows] = state.qpos[self._arm_qpos]
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

    def set_gripper_pose(self, pose: np.ndarray, row: Any = ...) -> bool:
        """Sets what `gripper_pose` returns for one simulation, until its physics advances.

        Returns:
            Whether it is another than that of the physics: then positions were observed one substep
            behind.
        """
        if self.observes_current_state:
            return False  # It follows from the state, to the bit.
        self._forget_restored(row)
        is_other = np.abs(self.gripper_pose(row) - pose).max() > _SAME_POSE
        if self._restored is None:
            self._restored = np.full((*self._gripper_position.shape[:-1], 7), np.nan)
        self._restored[row] = pose
        return bool(is_other)

    def _forget_restored(self, rows: Any) -> None:
        if self._restored is not None:
            self._restored[rows] = np.nan
            if np.isnan(self._restored).all():
                self._restored = None

    def act(self, action: np.ndarray, rows: Any = ...) -> None:
        """Asks for what an action asks for, before the physics advances.

        Args:
            action: (..., n) clipped actions of those simulations.
            rows: An index of the simulations to write to; ... for all.
        """
        if self._moves_joints:
            self._move_joints(action[..., :-1], rows)
        else:
            self._move_gripper(action, rows)
        if not self._locked_gripper:
            self._finger_control[rows] = self._fingers[rows] + action[..., -1:]

    def _move_joints(self, change: np.ndarray, rows: Any) -> None:
        """Moves the targets of the servos.

        A target moves from where it is, not from where its joint is, so that a 0 holds the arm
        and changes add up. Like a rotation, it does not get far ahead of what cannot follow.
        """
        targets = self._targets[rows] + change * JOINT_RADIANS_PER_UNIT
        joints = self._qpos[rows][..., self._arm_qpos]
        targets = targets.clip(joints - _FURTHEST_TARGET, joints + _FURTHEST_TARGET)
        self._targets[rows] = targets.clip(self._lowest_target, self._highest_target)

    def _move_gripper(self, action: np.ndarray, rows: Any) -> None:
        """Moves the mocap body, to which the gripper is welded, from where the gripper is."""
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
            self._mocap_quaternion[rows] = quaternion[rows] + ADDED_ROTATION
        elif self._turns_gripper:
            self._mocap_quaternion[rows] = self._turned(action[..., 3:-1], rows)
        else:
            self._mocap_quaternion[rows] = FIXED_ROTATION

    def _turned(self, rotation: np.ndarray, rows: Any) -> np.ndarray:
        """Returns the mocap body's orientation, turned.

        It is its own that is turned, not the gripper's: what an object or the softness of the weld
        does to that is undone, so that a 0 holds it and rotations add up. But a gripper that
        cannot follow, such as at the end of a joint's range, is not left behind for long: else
        turning back would do nothing at first, and half a turn ahead would be half a turn behind.

        Args:
            rotation: (..., 1 or 3) last components of a rotation vector, in units.
            rows: As for `act`.
        """
        vector = np.zeros((*rotation.shape[:-1], 3))
        vector[..., -rotation.shape[-1] :] = rotation
        vector *= RADIANS_PER_UNIT
        return rotations.held_near(
            rotations.turned(self._mocap_quaternion[rows], vector),
            self._gripper_quaternion[rows],
            _FURTHEST_ROTATION,
            axes=rotation.shape[-1],
        )

    def relock(self, rows: Any = ...) -> None:
        """Puts loose fingers back, after the physics has advanced."""
        if self.loose_fingers:
            self._fingers[rows] = 0
