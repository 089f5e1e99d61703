"""What runs on the device beside the physics, a thread for each environment."""

import dm_env
import warp as wp

from fetch_composer.warp_batch import philox
from fetch_composer.warp_batch.structs import (
    Episodes,
    Layout,
    Output,
    Physics,
    Rules,
    Scene,
    Start,
)

# What an environment has done that nobody has been told of.
ACTION_FAULT = 1
DIVERGED = 2

FIRST, MID, LAST = map(int, dm_env.StepType)

_LARGEST = wp.constant(1e10)  # What MuJoCo takes for a divergence.
_SINGULAR_COSINE = wp.constant(4.0 * 2.0**-23)  # As the native observers', of this precision.
_MOST_DRAWS = wp.constant(1000)
_FIRST_PLACE = wp.constant(8)  # Of the numbers of a stream; a goal takes the ones before.


@wp.kernel(enable_backward=False)
def act(
    scene: Scene,
    physics: Physics,
    episodes: Episodes,
    actions: wp.array2d(dtype=float),
):
    """Asks the physics for what actions ask for; an action that is not finite asks for nothing."""
    i = wp.tid()
    displacement = wp.vec3(actions[i, 0], actions[i, 1], actions[i, 2])
    opening = actions[i, 3]
    is_valid = wp.isfinite(displacement) and wp.isfinite(opening)
    if episodes.is_over[i] or not is_valid:
        displacement = wp.vec3()
        opening = float(0.0)
    if not episodes.is_over[i] and not is_valid:
        episodes.faults[i] = episodes.faults[i] | ACTION_FAULT
    for j in range(3):
        displacement[j] = wp.clamp(displacement[j], -1.0, 1.0) * scene.metres_per_unit
    physics.mocap_pos[i, scene.mocap] = episodes.gripper_position[i] + displacement
    physics.mocap_quat[i, scene.mocap] = (
        episodes.gripper_quaternion[i] * scene.follows_rotation + scene.added_rotation
    )
    if scene.fingers_control >= 0:
        for j in range(2):
            at = physics.qpos[i, scene.fingers_qpos + j]
            physics.ctrl[i, scene.fingers_control + j] = at + wp.clamp(opening, -1.0, 1.0)


@wp.func
def _draw_goal(rules: Rules, key: philox.Key, stream: wp.uint32) -> wp.vec3:
    offset = wp.vec3()
    for j in range(3):
        offset[j] = philox.between(key, stream, j, rules.goal_range[j])
    if philox.uniform(key, stream, 3) < rules.air_probability:
        offset[2] += philox.uniform(key, stream, 4) * rules.air_height
    return rules.goal_centre + offset


@wp.func
def _draw_place(rules: Rules, key: philox.Key, stream: wp.uint32) -> wp.vec2:
    offset = wp.vec2()
    for attempt in range(_MOST_DRAWS):
        index = _FIRST_PLACE + 2 * attempt
        offset[0] = philox.between(key, stream, index, rules.object_range)
        offset[1] = philox.between(key, stream, index + 1, rules.object_range)
        if wp.length(offset) >= rules.object_clearance:
            break
    return rules.object_centre + offset


@wp.func
def _place(scene: Scene, physics: Physics, start: Start, at: wp.vec2, i: int):
    for j in range(start.qpos.shape[0]):
        physics.qpos[i, j] = start.qpos[j]
    for j in range(start.qvel.shape[0]):
        physics.qvel[i, j] = start.qvel[j]
        physics.warmstart[i, j] = 0.0
    for j in range(physics.ctrl.shape[1]):
        physics.ctrl[i, j] = 0.0
    physics.time[i] = 0.0
    physics.mocap_pos[i, scene.mocap] = start.mocap_pos
    physics.mocap_quat[i, scene.mocap] = start.mocap_quat
    if scene.object_qpos >= 0:
        physics.qpos[i, scene.object_qpos] = at[0]
        physics.qpos[i, scene.object_qpos + 1] = at[1]


@wp.func
def _has_diverged(physics: Physics, i: int) -> bool:
    diverged = bool(False)
    for j in range(physics.qpos.shape[1]):
        if not (wp.abs(physics.qpos[i, j]) < _LARGEST):
            diverged = True
    for j in range(physics.qvel.shape[1]):
        if not (wp.abs(physics.qvel[i, j]) < _LARGEST):
            diverged = True
    return diverged


@wp.func
def _begin(scene: Scene, physics: Physics, rules: Rules, start: Start, episodes: Episodes, i: int):
    """Starts an episode; everything is drawn, given or not, so that the rest stays as it was."""
    key, stream = episodes.key[i], episodes.drawn[i]
    goal, place = _draw_goal(rules, key, stream), _draw_place(rules, key, stream)
    if not wp.isnan(rules.usual_goal):
        goal = rules.usual_goal
    if not wp.isnan(rules.usual_place):
        place = rules.usual_place
    if not wp.isnan(episodes.given_goal[i]):
        goal = episodes.given_goal[i]
    if not wp.isnan(episodes.given_place[i]):
        place = episodes.given_place[i]
    _place(scene, physics, start, place, i)
    episodes.drawn[i] = stream + wp.uint32(1)
    episodes.goal[i] = goal
    episodes.given_goal[i] = wp.vec3(wp.nan)
    episodes.given_place[i] = wp.vec2(wp.nan)
    episodes.steps_taken[i] = 0
    episodes.is_over[i] = False
    episodes.has_started[i] = True
    episodes.is_placed[i] = True


@wp.kernel(enable_backward=False)
def begin(
    scene: Scene,
    physics: Physics,
    rules: Rules,
    start: Start,
    episodes: Episodes,
    chosen: wp.array(dtype=bool),
):
    """Starts episodes in chosen environments."""
    i = wp.tid()
    episodes.has_started[i] = False
    episodes.is_placed[i] = False
    if chosen[i]:
        _begin(scene, physics, rules, start, episodes, i)


@wp.kernel(enable_backward=False)
def finish(scene: Scene, physics: Physics, rules: Rules, start: Start, episodes: Episodes):
    """Ends a control step: counts it, or starts the next episode where one was over."""
    i = wp.tid()
    episodes.has_started[i] = False
    episodes.is_placed[i] = False
    if episodes.is_over[i]:
        _begin(scene, physics, rules, start, episodes, i)
        return
    if scene.loose_fingers:
        for j in range(2):
            physics.qpos[i, scene.fingers_qpos + j] = 0.0
    episodes.steps_taken[i] += 1
    episodes.is_over[i] = rules.limit > 0 and episodes.steps_taken[i] >= rules.limit
    if _has_diverged(physics, i):
        _place(scene, physics, start, rules.object_centre + wp.vec2(rules.object_range), i)
        episodes.faults[i] = episodes.faults[i] | DIVERGED
        episodes.is_over[i] = True
        episodes.is_placed[i] = True


@wp.func
def _velocity(
    scene: Scene, physics: Physics, first: int, end: int, site: int, root: int, i: int
) -> wp.spatial_vector:
    """Returns a site's angular and linear velocity in rad/s and m/s."""
    spatial = wp.spatial_vector()
    for j in range(first, end):
        dof = scene.movers[j]
        spatial += physics.qvel[i, dof] * physics.cdof[i, dof]
    angular = wp.spatial_top(spatial)
    arm = physics.site_xpos[i, site] - physics.subtree_com[i, root]
    return wp.spatial_vector(angular, wp.spatial_bottom(spatial) - wp.cross(arm, angular))


@wp.func
def _euler_xyz(mat: wp.mat33) -> wp.vec3:
    cosine = wp.sqrt(mat[1, 2] * mat[1, 2] + mat[2, 2] * mat[2, 2])
    middle = wp.atan2(mat[0, 2], cosine)
    if cosine > _SINGULAR_COSINE:
        return wp.vec3(wp.atan2(-mat[1, 2], mat[2, 2]), middle, wp.atan2(-mat[0, 1], mat[0, 0]))
    return wp.vec3(0.0, middle, wp.atan2(mat[1, 0], mat[1, 1]))


@wp.func
def _write(to: wp.array2d(dtype=float), i: int, place: int, value: wp.vec3):
    for j in range(3):
        to[i, place + j] = value[j]


@wp.kernel(enable_backward=False)
def observe(
    scene: Scene,
    layout: Layout,
    physics: Physics,
    episodes: Episodes,
    placed_only: bool,
    output: Output,
):
    """Observes positions and velocities as the physics has them, and remembers the gripper's pose.

    Args:
        placed_only: Whether to observe those environments alone that were just put in place.
    """
    i = wp.tid()
    if placed_only and not episodes.is_placed[i]:
        return
    episodes.gripper_position[i] = physics.xpos[i, scene.gripper_link]
    episodes.gripper_quaternion[i] = physics.xquat[i, scene.gripper_link]
    dt = scene.timestep
    grip = physics.site_xpos[i, scene.grip_site]
    motion = _velocity(
        scene, physics, 0, scene.num_grip_movers, scene.grip_site, scene.grip_root, i
    )
    grip_velocity = wp.spatial_bottom(motion) * dt
    _write(output.observation, i, layout.grip_position, grip)
    _write(output.observation, i, layout.grip_velocity, grip_velocity)
    for j in range(2):
        opening, speed = float(0.0), float(0.0)
        if scene.fingers_qpos >= 0:
            opening = physics.qpos[i, scene.fingers_qpos + j]
            speed = physics.qvel[i, scene.fingers_qvel + j]
        output.observation[i, layout.fingers + j] = opening
        output.observation[i, layout.finger_velocities + j] = speed * dt
    achieved = grip
    if scene.object_site >= 0:
        achieved = physics.site_xpos[i, scene.object_site]
        motion = _velocity(
            scene, physics, scene.num_grip_movers, scene.movers.shape[0],
            scene.object_site, scene.object_root, i,
        )  # fmt: skip
        rotation = _euler_xyz(physics.site_xmat[i, scene.object_site])
        velocity = wp.spatial_bottom(motion) * dt - grip_velocity
        _write(output.observation, i, layout.object_position, achieved)
        _write(output.observation, i, layout.relative_position, (achieved - grip) * scene.sense)
        _write(output.observation, i, layout.object_rotation, rotation)
        _write(output.observation, i, layout.object_velocity, velocity)
        _write(output.observation, i, layout.object_spin, wp.spatial_top(motion) * dt)
    _write(output.achieved_goal, i, 0, achieved)


@wp.kernel(enable_backward=False)
def judge(rules: Rules, episodes: Episodes, advanced: bool, output: Output):
    """Gives rewards and types of time steps.

    Args:
        advanced: Whether environments whose episodes have not just started have advanced; else
            they keep the type that they had.
    """
    i = wp.tid()
    goal = episodes.goal[i]
    achieved = wp.vec3(
        output.achieved_goal[i, 0], output.achieved_goal[i, 1], output.achieved_goal[i, 2]
    )
    distance = wp.length(achieved - goal)
    reward, discount = float(0.0), float(1.0)
    if advanced and not episodes.has_started[i]:
        reward = -distance
        if not rules.is_dense:
            reward = wp.where(distance < rules.threshold, 0.0, -1.0)
        if rules.ends_at_goal and distance < rules.threshold:
            episodes.is_over[i] = True
            discount = 0.0
        output.step_type[i] = wp.where(episodes.is_over[i], LAST, MID)
    if episodes.has_started[i]:
        output.step_type[i] = FIRST
    _write(output.desired_goal, i, 0, goal)
    output.reward[i] = reward
    output.discount[i] = discount


@wp.kernel(enable_backward=False)
def tell(episodes: Episodes, overflow: wp.array(dtype=int), mask: int, faults: wp.array(dtype=int)):
    """Sums up what has gone wrong in any environment."""
    i = wp.tid()
    found = episodes.faults[i] | (overflow[i] & mask)
    if found != 0:
        wp.atomic_or(faults, 0, found)
