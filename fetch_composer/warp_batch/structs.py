"""What kernels are given: structs of numbers and of arrays of the device."""

import warp as wp

from fetch_composer.warp_batch import philox


@wp.struct
class Scene:
    """Where things are in the model, and what its convention chooses.

    Those of what a task does not have are -1. `movers` are the degrees of freedom that move the
    gripper, and then those that move the object.
    """

    gripper_link: int
    mocap: int
    grip_site: int
    grip_root: int
    object_site: int
    object_root: int
    object_qpos: int
    fingers_qpos: int
    fingers_qvel: int
    fingers_control: int
    num_grip_movers: int
    movers: wp.array(dtype=int)
    metres_per_unit: float
    added_rotation: wp.quat
    follows_rotation: float
    loose_fingers: bool
    timestep: float
    sense: float


@wp.struct
class Layout:
    """Where an observation has what; see `tasks.layout`."""

    grip_position: int
    fingers: int
    grip_velocity: int
    finger_velocities: int
    object_position: int
    relative_position: int
    object_rotation: int
    object_velocity: int
    object_spin: int


@wp.struct
class Rules:
    """How episodes start and end; `usual_*` are those of every episode, and NaN if they differ."""

    usual_goal: wp.vec3
    usual_place: wp.vec2
    goal_centre: wp.vec3
    goal_range: wp.vec3
    air_probability: float
    air_height: float
    object_centre: wp.vec2
    object_range: float
    object_clearance: float
    limit: int  # 0 for none.
    ends_at_goal: bool
    is_dense: bool
    threshold: float


@wp.struct
class Physics:
    """Arrays of MuJoCo Warp's data."""

    time: wp.array(dtype=float)
    qpos: wp.array2d(dtype=float)
    qvel: wp.array2d(dtype=float)
    warmstart: wp.array2d(dtype=float)
    ctrl: wp.array2d(dtype=float)
    mocap_pos: wp.array2d(dtype=wp.vec3)
    mocap_quat: wp.array2d(dtype=wp.quat)
    xpos: wp.array2d(dtype=wp.vec3)
    xquat: wp.array2d(dtype=wp.quat)
    site_xpos: wp.array2d(dtype=wp.vec3)
    site_xmat: wp.array2d(dtype=wp.mat33)
    subtree_com: wp.array2d(dtype=wp.vec3)
    cdof: wp.array2d(dtype=wp.spatial_vector)


@wp.struct
class Start:
    """The state that every episode starts from, but for the object's place."""

    qpos: wp.array(dtype=float)
    qvel: wp.array(dtype=float)
    mocap_pos: wp.vec3
    mocap_quat: wp.quat


@wp.struct
class Episodes:
    """Where each environment is in its episodes.

    `given_*` are of the next one, and NaN if nothing is. `is_placed` and `has_started` are of the
    latest call: whether a state was put in place, and whether that was a start.
    """

    key: wp.array(dtype=philox.Key)
    drawn: wp.array(dtype=wp.uint32)
    goal: wp.array(dtype=wp.vec3)
    steps_taken: wp.array(dtype=int)
    is_over: wp.array(dtype=bool)
    has_started: wp.array(dtype=bool)
    is_placed: wp.array(dtype=bool)
    given_place: wp.array(dtype=wp.vec2)
    given_goal: wp.array(dtype=wp.vec3)
    gripper_position: wp.array(dtype=wp.vec3)
    gripper_quaternion: wp.array(dtype=wp.quat)
    faults: wp.array(dtype=int)


@wp.struct
class Output:
    """What a time step consists of."""

    observation: wp.array2d(dtype=float)
    achieved_goal: wp.array2d(dtype=float)
    desired_goal: wp.array2d(dtype=float)
    reward: wp.array(dtype=float)
    discount: wp.array(dtype=float)
    step_type: wp.array(dtype=int)
