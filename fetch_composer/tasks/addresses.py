"""Where the parts of a scene are in its compiled model, so that names are looked up once."""

import dataclasses

import numpy as np
from dm_control import mjcf

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
        return cls(
            gripper_link=physics.bind(scene.gripper.gripper_link).element_id,
            mocap=model.body_mocapid[model.body(scene.mocap_frame.full_identifier).id],
            target=model.body(scene.target_frame.full_identifier).id,
            grip_site=physics.bind(scene.gripper.tool_center_point).element_id,
            object_site=object_site,
            arm_qpos=model.jnt_qposadr[physics.bind(scene.arm.joints).element_id],
            finger_qpos=finger_qpos,
            finger_qvel=finger_qvel,
            object_qpos=object_qpos,
            object_qvel=object_qvel,
        )


def _slice(first: int, count: int) -> slice:
    return slice(int(first), int(first) + count)
