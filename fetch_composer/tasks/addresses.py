"""Where the parts of a scene are in its compiled model, so that names are looked up once."""

import dataclasses

import numpy as np
from dm_control import mjcf
from dm_control.entities.manipulators import base

from fetch_composer.tasks.scene import Scene


@dataclasses.dataclass(frozen=True)
class Addresses:
    """Ids in the compiled model, and places in its state.

    Attributes:
        gripper_link: Id of the body that is welded to the mocap body.
        mocap: Index of the mocap body.
        target: Id of the target's body.
        grip_site: Id of the gripper's observed site.
        object_site: Id of the object's observed site, or None.
        arm_qpos: (7,) positions of the arm's joints in qpos.
        finger_qpos: The right and the left finger's joint in qpos; empty if they are rigid.
        finger_qvel: The same in qvel.
        finger_control: The same in ctrl; empty if they are locked.
        arm_control: The targets of the arm's joints in ctrl; empty if no servos move them.
        arm_control_range: (7, 2) range of these targets in rad, infinite where a joint turns
            without end.
        object_qpos: The object's pose in qpos; empty without one.
        object_qvel: The object's velocity in qvel; empty without one.
    """

    gripper_link: int
    mocap: int
    target: int
    grip_site: int
    object_site: int | None
    arm_qpos: np.ndarray
    finger_qpos: slice
    finger_qvel: slice
    finger_control: slice
    arm_control: slice
    arm_control_range: np.ndarray
    object_qpos: slice
    object_qvel: slice

    @classmethod
    def of(cls, scene: Scene, physics: mjcf.Physics) -> 'Addresses':
        """Returns the addresses of a scene in `physics`, which was compiled from it."""
        model = physics.model.ptr
        finger_qpos = finger_qvel = object_qpos = object_qvel = slice(0)
        object_site = None
        if scene.gripper.joints:
            right, left = (physics.bind(joint).element_id for joint in scene.gripper.joints)
            assert left == right + 1, 'Both fingers are read and written as one slice.'
            finger_qpos = _slice(model.jnt_qposadr[right], 2)
            finger_qvel = _slice(model.jnt_dofadr[right], 2)
        if scene.block is not None:
            joint = physics.bind(scene.block_joint).element_id
            object_qpos = _slice(model.jnt_qposadr[joint], 7)
            object_qvel = _slice(model.jnt_dofadr[joint], 6)
            object_site = physics.bind(scene.block.site).element_id
        arm_control, endless = _controls(scene.arm, physics), (-np.inf, np.inf)
        is_limited = model.actuator_ctrllimited[arm_control, np.newaxis]
        return cls(
            gripper_link=physics.bind(scene.gripper.gripper_link).element_id,
            mocap=model.body_mocapid[model.body(scene.mocap_frame.full_identifier).id],
            target=model.body(scene.target_frame.full_identifier).id,
            grip_site=physics.bind(scene.gripper.tool_center_point).element_id,
            object_site=object_site,
            arm_qpos=model.jnt_qposadr[physics.bind(scene.arm.joints).element_id],
            finger_qpos=finger_qpos,
            finger_qvel=finger_qvel,
            finger_control=_controls(scene.gripper, physics),
            arm_control=arm_control,
            arm_control_range=np.where(is_limited, model.actuator_ctrlrange[arm_control], endless),
            object_qpos=object_qpos,
            object_qvel=object_qvel,
        )


def _controls(entity: base.RobotArm | base.RobotHand, physics: mjcf.Physics) -> slice:
    """Returns where the controls of an arm or a hand are, which follow one another."""
    if not entity.actuators:
        return slice(0)
    return _slice(physics.bind(entity.actuators[0]).element_id, len(entity.actuators))


def _slice(first: int, count: int) -> slice:
    return slice(int(first), int(first) + count)
