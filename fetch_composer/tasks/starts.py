"""The state from which episodes start: at rest as documented, or settled as the peer's."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from dm_control import composer, mjcf
from dm_control.utils import inverse_kinematics

from fetch_composer.tasks import conventions
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.scene import Scene

# Configuration from which inverse kinematics starts, shoulder to wrist in rad: elbow up, near
# the pose in which Gymnasium-Robotics settles.
_ELBOW_UP = (0.01, -0.83, 0.0, 1.44, 0.0, 0.95, 0.0)
_TOLERANCE = 1e-12  # Of the inverse kinematics, in m and rad.
_MAX_ERROR = 1e-5  # m


@dataclasses.dataclass(frozen=True)
class Start:
    """What differs between the starts of two episodes.

    Attributes:
        object_position: (2,) x and y in m at which the object starts; None without one.
        goal: (3,) desired goal in m.
        variations: What was drawn for this episode, by name of the variation.
    """

    object_position: np.ndarray | None = None
    goal: np.ndarray | None = None
    variations: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class StartState:
    """(nq,) qpos, (nv,) qvel, and the mocap body's position in m and quaternion."""

    qpos: np.ndarray
    qvel: np.ndarray
    mocap_position: np.ndarray
    mocap_quaternion: np.ndarray


def documented_state(
    scene: Scene,
    physics: mjcf.Physics,
    addresses: Addresses,
    gripper_position: Sequence[float],
    object_height: float | None,
) -> StartState:
    """Returns the state at rest with the gripper link at a position, pointing down.

    Args:
        scene: The scene.
        physics: Its physics, whose state is changed.
        addresses: Its addresses.
        gripper_position: (3,) position of the gripper link's frame in m.
        object_height: Height of the object's centre in m, or None without one.

    Raises:
        EpisodeInitializationError: if inverse kinematics finds no such configuration.
    """
    model = physics.model.ptr
    qpos = model.qpos0.copy()
    qpos[addresses.arm_qpos] = _solve(scene, physics, addresses, gripper_position)
    if scene.block is not None:
        block_qpos = qpos[addresses.object_qpos]
        block_qpos[2] = object_height
        block_qpos[3:] = scene.block.quaternion
    for prop, joint, position in scene.props:
        address = model.jnt_qposadr[physics.bind(joint).element_id]
        qpos[address : address + 7] = (*position, *prop.quaternion)
    return StartState(
        qpos=qpos,
        qvel=np.zeros(model.nv),
        mocap_position=np.array(gripper_position, dtype=np.float64),
        mocap_quaternion=np.array(conventions.POINTING_DOWN),
    )


def _solve(scene, physics, addresses, gripper_position) -> np.ndarray:
    """Returns (7,) arm joints in rad."""
    joints = scene.arm.joints
    physics.bind(joints).qpos = _ELBOW_UP
    result = inverse_kinematics.qpos_from_site_pose(
        physics,
        scene.arm.wrist_site.full_identifier,
        target_pos=np.asarray(gripper_position),
        target_quat=conventions.POINTING_DOWN,
        joint_names=[joint.full_identifier for joint in joints],
        tol=_TOLERANCE,
        inplace=True,
    )
    if result.err_norm > _MAX_ERROR:
        raise composer.EpisodeInitializationError(
            f'The gripper cannot be brought to {np.round(gripper_position, 4).tolist()} m, '
            f'pointing down: inverse kinematics is left with an error of {result.err_norm:.2g}.'
        )
    return result.qpos[addresses.arm_qpos]


def settled_state(
    scene: Scene, physics: mjcf.Physics, addresses: Addresses, task_name: str
) -> StartState:
    """Returns the state in which the peer has settled."""
    model, state = physics.model.ptr, conventions.settled_state(task_name)
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    for joint in (*scene.arm.base_joints, *scene.arm.joints, *scene.gripper.joints):
        index = model.joint(joint.full_identifier).id
        qpos[model.jnt_qposadr[index]] = state.qpos[joint.name]
        qvel[model.jnt_dofadr[index]] = state.qvel[joint.name]
    if scene.block is not None:
        qpos[addresses.object_qpos] = state.object_qpos
        qvel[addresses.object_qvel] = state.object_qvel
    # The peer leaves its mocap body at the origin until the first action moves it.
    return StartState(qpos, qvel, np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0)))
