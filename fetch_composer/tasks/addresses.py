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
        targets: Id of the body of each target.
        target_sites: Id of the site of each target.
        grip_site: Id of the gripper's observed site.
        object_sites: Id of each object's observed site.
        arm_qpos: (7,) positions of the arm's joints in qpos.
        finger_qpos: The right and the left finger's joint in qpos; empty if they are rigid.
        finger_qvel: The same in qvel.
        finger_control: The same in ctrl; empty if they are locked.
        arm_control: The targets of the arm's joints in ctrl; empty if no servos move them.
        arm_control_range: (7, 2) range of these targets in rad, infinite where a joint turns
            without end.
        object_qpos: Each object's pose in qpos.
        object_qvel: Each object's velocity in qvel.
        prop_qpos: The pose of each prop whose place is drawn in qpos.
    """

    gripper_link: int
    mocap: int
    targets: np.ndarray
    target_sites: np.ndarray
    grip_site: int
    object_sites: tuple[int, ...]
    arm_qpos: np.ndarray
    finger_qpos: slice
    finger_qvel: slice
    finger_control: slice
    arm_control: slice
    arm_control_range: np.ndarray
    object_qpos: tuple[slice, ...]
    object_qvel: tuple[slice, ...]
    prop_qpos: tuple[slice, ...]

    @classmethod
    def of(cls, scene: Scene, physics: mjcf.Physics) -> 'Addresses':
        """Returns the addresses of a scene in `physics`, which was compiled from it."""
        model = physics.model.ptr
        finger_qpos = finger_qvel = slice(0)
        if scene.gripper.joints:
            right, left = (physics.bind(joint).element_id for joint in scene.gripper.joints)
            assert left == right + 1, 'Both fingers are read and written as one slice.'
            finger_qpos = _slice(model.jnt_qposadr[right], 2)
            finger_qvel = _slice(model.jnt_dofadr[right], 2)
        joints = [physics.bind(joint).element_id for joint in scene.object_joints]
        props = [physics.bind(each.joint).element_id for each in scene.drawn_props]
        arm_control, endless = _controls(scene.arm, physics), (-np.inf, np.inf)
        is_limited = model.actuator_ctrllimited[arm_control, np.newaxis]
        return cls(
            gripper_link=physics.bind(scene.gripper.gripper_link).element_id,
            mocap=model.body_mocapid[model.body(scene.mocap_frame.full_identifier).id],
            targets=np.array(
                [model.body(frame.full_identifier).id for frame in scene.target_frames]
            ),
            target_sites=np.array([physics.bind(each.site).element_id for each in scene.targets]),
            grip_site=physics.bind(scene.gripper.tool_center_point).element_id,
            object_sites=tuple(physics.bind(each.site).element_id for each in scene.objects),
            arm_qpos=model.jnt_qposadr[physics.bind(scene.arm.joints).element_id],
            finger_qpos=finger_qpos,
            finger_qvel=finger_qvel,
            finger_control=_controls(scene.gripper, physics),
            arm_control=arm_control,
            arm_control_range=np.where(is_limited, model.actuator_ctrlrange[arm_control], endless),
            object_qpos=tuple(_slice(model.jnt_qposadr[joint], 7) for joint in joints),
            object_qvel=tuple(_slice(model.jnt_dofadr[joint], 6) for joint in joints),
            prop_qpos=tuple(_slice(model.jnt_qposadr[joint], 7) for joint in props),
        )


def _controls(entity: base.RobotArm | base.RobotHand, physics: mjcf.Physics) -> slice:
    """Returns where the controls of an arm or a hand are, which follow one another."""
    if not entity.actuators:
        return slice(0)
    return _slice(physics.bind(entity.actuators[0]).element_id, len(entity.actuators))


def _slice(first: int, count: int) -> slice:
    return slice(int(first), int(first) + count)
