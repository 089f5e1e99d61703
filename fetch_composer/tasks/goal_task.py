"""A goal-conditioned manipulation task for the Fetch, of which Push and its kin are instances."""

import collections
import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import composer
from dm_control.composer import variation
from dm_control.composer.observation import observable
from dm_control.utils import inverse_kinematics
from dm_env import specs

from fetch_composer import entities
from fetch_composer.tasks import conventions, observation, rewards
from fetch_composer.tasks import scene as scene_lib

CONTROL_TIMESTEP = 0.04  # s, 25 Hz.
PHYSICS_TIMESTEP = 0.002  # s
MAX_EPISODE_STEPS = 50

ACTION_SIZE = 4
METRES_PER_UNIT = 0.05  # Displacement that an action of 1 asks for.
_ADDED_ROTATION = np.array((1.0, 0.0, 1.0, 0.0))

# Configuration from which inverse kinematics starts, shoulder to wrist in rad: elbow up, near
# the pose in which Gymnasium-Robotics settles.
_ELBOW_UP = (0.01, -0.83, 0.0, 1.44, 0.0, 0.95, 0.0)
_START_TOLERANCE = 1e-12  # Of the inverse kinematics, in m and rad.
_MAX_START_ERROR = 1e-5  # m


@dataclasses.dataclass(frozen=True)
class _Compiled:
    """Ids, addresses and views in the compiled model: names are looked up once."""

    model: mujoco.MjModel
    data: mujoco.MjData
    observer: observation.GoalObserver
    gripper_position: np.ndarray
    gripper_quaternion: np.ndarray
    mocap_position: np.ndarray
    mocap_quaternion: np.ndarray
    target_position: np.ndarray
    arm_qpos: np.ndarray
    finger_qpos: np.ndarray
    object_qpos: slice
    object_qvel: slice


class GoalTask(composer.Task):
    """Move the gripper by small displacements so that a goal is achieved, and keep it so.

    A subclass names its workspace, brings its object and says how starts and goals are sampled.
    The task is continuing: an episode is only ever truncated, with discount 1.
    """

    def __init__(
        self,
        name: str,
        workspace: scene_lib.Workspace,
        block: entities.Block | None = None,
        locked_gripper: bool = True,
        reward_type: str = 'sparse',
        max_episode_steps: int | None = MAX_EPISODE_STEPS,
        convention: str = 'documented',
        block_position: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
    ) -> None:
        """Initializes the task.

        Args:
            name: Name of the task, as passed to `load`.
            workspace: Where things are.
            block: The object, or None if the gripper itself is to be at the goal.
            locked_gripper: Whether the gripper stays closed.
            reward_type: 'sparse' or 'dense'.
            max_episode_steps: Control steps after which an episode is truncated; None for
                episodes that never end.
            convention: 'documented' or 'gymnasium'.
            block_position: (2,) x and y in m at which the object starts in every episode.
            goal: (3,) desired goal in m of every episode.

        Raises:
            ValueError: if an argument is not valid; the message says what would be.
        """
        rewards.check_reward_type(reward_type)
        check_max_episode_steps(max_episode_steps)
        self.name = name
        self.convention = conventions.get(convention)
        self.workspace = workspace
        self.reward_type = reward_type
        self.max_episode_steps = max_episode_steps
        self.locked_gripper = locked_gripper
        self.visualize_reward = False
        self.scene = scene_lib.Scene(workspace, self.convention, block, locked_gripper)
        self.set_timesteps(control_timestep=CONTROL_TIMESTEP, physics_timestep=PHYSICS_TIMESTEP)
        self._task_observables = self._build_task_observables()

        self._block_placer, self._goal_sampler = self._build_samplers()
        self._every_episode = self._check_given(block_position, goal)
        self._next_episode = _Given()

        self._goal = np.zeros(3)
        self._steps_taken = 0
        self._start_configuration: np.ndarray | None = None

    def _build_samplers(self) -> tuple[variation.Variation | None, variation.Variation]:
        """Returns what samples the object's x and y (None without one) and the desired goal."""
        raise NotImplementedError

    def _build_task_observables(self):
        observables = collections.OrderedDict(
            observation=observable.Generic(lambda _: self._compiled.observer.observation()),
            achieved_goal=observable.Generic(lambda _: self._compiled.observer.achieved_goal()),
            desired_goal=observable.Generic(lambda _: self._goal.copy()),
        )
        for each in observables.values():
            each.enabled = True
        return observables

    @property
    def root_entity(self) -> entities.Arena:
        return self.scene.arena

    @property
    def task_observables(self):
        return self._task_observables

    # -- Where an episode starts ---------------------------------------------------------------

    @property
    def grip_start(self) -> np.ndarray:
        """(3,) start of the observed grip site in m; starts and goals are sampled around it."""
        if self.convention.settled_start:
            return conventions.settled_state(self.name).grip_position
        grip_ahead = self.scene.gripper.tool_center_point.pos[0]  # The gripper points down.
        return np.array(self.workspace.gripper_position) - (0, 0, grip_ahead)

    @property
    def object_height(self) -> float | None:
        """Height in m at which the centre of the object rests on the table; None without one."""
        return conventions.settled_state(self.name).object_height

    def set_next_episode(
        self,
        block_position: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
    ) -> None:
        """Gives the start or the goal of the next episode, and of that one only.

        Whatever is not given is sampled, and is the same as if nothing had been given.

        Args:
            block_position: (2,) x and y of the object in m, on the table.
            goal: (3,) desired goal in m.

        Raises:
            ValueError: if a place cannot be; the task is then unchanged.
        """
        self._next_episode = self._check_given(block_position, goal)

    def _check_given(self, block_position, goal) -> '_Given':
        if block_position is not None:
            if self.scene.block is None:
                raise ValueError(f'block_position was given, but {self.name!r} has no object.')
            block_position = self.workspace.check_block_position(block_position)
        if goal is not None:
            goal = self.workspace.check_goal(goal)
        return _Given(block_position, goal)

    # -- Composer's hooks ----------------------------------------------------------------------

    def after_compile(self, physics, random_state) -> None:
        del random_state  # Unused.
        self._compiled = self._resolve(physics)
        if not self.convention.settled_start and self._start_configuration is None:
            self._start_configuration = self._solve_start(physics)

    def initialize_episode(self, physics, random_state) -> None:
        del physics  # Written to through the compiled views.
        self._steps_taken = 0
        given, self._next_episode = self._next_episode, _Given()
        # Everything is drawn whether given or not, so that giving one leaves the other as it was.
        block_position = None
        if self._block_placer is not None:
            block_position = self._block_placer(random_state=random_state)
        self._goal = self._goal_sampler(random_state=random_state)
        for source in (self._every_episode, given):
            if source.block_position is not None:
                block_position = source.block_position
            if source.goal is not None:
                self._goal = source.goal.copy()

        if self.convention.settled_start:
            self._start_settled()
        else:
            self._start_at_rest()
        if block_position is not None:
            self._compiled.data.qpos[self._compiled.object_qpos][:2] = block_position
        self._compiled.target_position[:] = self._goal

    def before_step(self, physics, action, random_state) -> None:
        del physics, random_state  # Unused.
        action = clip_action(action)
        self._steps_taken += 1
        compiled = self._compiled
        compiled.mocap_position[:] = compiled.gripper_position + action[:3] * METRES_PER_UNIT
        if self.convention.additive_rotation:
            compiled.mocap_quaternion[:] = compiled.gripper_quaternion + _ADDED_ROTATION
        if not self.locked_gripper:
            compiled.data.ctrl[:] = compiled.data.qpos[compiled.finger_qpos] + action[3]

    def after_step(self, physics, random_state) -> None:
        del physics, random_state  # Unused.
        compiled = self._compiled
        if self.locked_gripper:
            compiled.data.qpos[compiled.finger_qpos] = 0
        elif not self.convention.refresh_unlocked:
            return
        # `mj_step` leaves positions and velocities one substep behind the state.
        mujoco.mj_kinematics(compiled.model, compiled.data)
        mujoco.mj_comPos(compiled.model, compiled.data)
        mujoco.mj_comVel(compiled.model, compiled.data)
        mujoco.mj_camlight(compiled.model, compiled.data)

    def action_spec(self, physics) -> specs.BoundedArray:
        del physics  # Unused.
        return specs.BoundedArray(
            shape=(ACTION_SIZE,),
            dtype=np.float32,
            minimum=-1,
            maximum=1,
            name='dx\tdy\tdz\tgripper',
        )

    def get_reward_spec(self) -> specs.Array:
        if self.reward_type == 'sparse':
            return specs.BoundedArray((), np.float64, minimum=-1, maximum=0, name='reward')
        return specs.BoundedArray((), np.float64, minimum=-np.inf, maximum=0, name='reward')

    def get_reward(self, physics) -> float:
        del physics  # Unused.
        achieved_goal = self._compiled.observer.achieved_goal()
        return float(rewards.compute_reward(achieved_goal, self._goal, self.reward_type))

    def is_success(self) -> bool:
        """Returns whether the goal is achieved now: whether it is less than 0.05 m away."""
        return bool(rewards.is_success(self._compiled.observer.achieved_goal(), self._goal))

    def should_terminate_episode(self, physics) -> bool:
        del physics  # Unused.
        return self.max_episode_steps is not None and self._steps_taken >= self.max_episode_steps

    def get_discount(self, physics) -> float:
        del physics  # Unused.
        return 1.0

    # -- The compiled model --------------------------------------------------------------------

    def _resolve(self, physics) -> _Compiled:
        scene, model, data = self.scene, physics.model.ptr, physics.data.ptr
        gripper_link = physics.bind(scene.gripper.gripper_link).element_id
        mocap = model.body_mocapid[model.body(scene.mocap_frame.full_identifier).id]
        fingers = [physics.bind(joint).element_id for joint in scene.gripper.joints]
        object_qpos = object_qvel = slice(0)
        object_site = None
        if scene.block is not None:
            joint = physics.bind(scene.block_joint).element_id
            qpos, qvel = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
            object_qpos, object_qvel = slice(qpos, qpos + 7), slice(qvel, qvel + 6)
            object_site = physics.bind(scene.block.site).element_id
        observer = observation.GoalObserver(
            model,
            data,
            grip_site=physics.bind(scene.gripper.tool_center_point).element_id,
            finger_joints=fingers,
            object_site=object_site,
            control_timestep=CONTROL_TIMESTEP,
            block_minus_gripper=self.convention.block_minus_gripper,
        )
        return _Compiled(
            model=model,
            data=data,
            observer=observer,
            gripper_position=data.xpos[gripper_link],
            gripper_quaternion=data.xquat[gripper_link],
            mocap_position=data.mocap_pos[mocap],
            mocap_quaternion=data.mocap_quat[mocap],
            target_position=model.body_pos[model.body(scene.target_frame.full_identifier).id],
            arm_qpos=model.jnt_qposadr[physics.bind(scene.arm.joints).element_id],
            finger_qpos=model.jnt_qposadr[fingers],
            object_qpos=object_qpos,
            object_qvel=object_qvel,
        )

    def _solve_start(self, physics) -> np.ndarray:
        """Returns (7,) arm joints in rad that put the gripper link at its documented pose."""
        joints = self.scene.arm.joints
        physics.bind(joints).qpos = _ELBOW_UP
        result = inverse_kinematics.qpos_from_site_pose(
            physics,
            self.scene.arm.wrist_site.full_identifier,
            target_pos=self.workspace.gripper_position,
            target_quat=conventions.POINTING_DOWN,
            joint_names=[joint.full_identifier for joint in joints],
            tol=_START_TOLERANCE,
        )
        if result.err_norm > _MAX_START_ERROR:
            raise composer.EpisodeInitializationError(
                f'The gripper cannot be brought to {self.workspace.gripper_position} m, pointing '
                f'down: inverse kinematics is left with an error of {result.err_norm:.2g}.'
            )
        return result.qpos[self._compiled.arm_qpos]

    def _start_at_rest(self) -> None:
        compiled = self._compiled
        compiled.data.qpos[compiled.arm_qpos] = self._start_configuration
        compiled.mocap_position[:] = self.workspace.gripper_position
        compiled.mocap_quaternion[:] = conventions.POINTING_DOWN
        if self.scene.block is not None:
            block_qpos = compiled.data.qpos[compiled.object_qpos]
            block_qpos[2] = self.object_height
            block_qpos[3:] = self.scene.block.quaternion

    def _start_settled(self) -> None:
        compiled, state = self._compiled, conventions.settled_state(self.name)
        model, data = compiled.model, compiled.data
        arm, gripper = self.scene.arm, self.scene.gripper
        for joint in (*arm.base_joints, *arm.joints, *gripper.joints):
            index = model.joint(joint.full_identifier).id
            data.qpos[model.jnt_qposadr[index]] = state.qpos[joint.name]
            data.qvel[model.jnt_dofadr[index]] = state.qvel[joint.name]
        if self.scene.block is not None:
            data.qpos[compiled.object_qpos] = state.object_qpos
            data.qvel[compiled.object_qvel] = state.object_qvel


@dataclasses.dataclass(frozen=True)
class _Given:
    """Places that are given rather than sampled; None where sampled."""

    block_position: np.ndarray | None = None
    goal: np.ndarray | None = None


def clip_action(action) -> np.ndarray:
    """Returns the action with each component clipped to [-1, 1], in its own precision.

    Args:
        action: (..., 4) displacement of the gripper along x, y and z, in units of 0.05 m, and
            the gripper's opening.

    Raises:
        ValueError: if it has another shape or is not finite.
    """
    array = np.asarray(action)
    if array.shape[-1:] != (ACTION_SIZE,) or array.ndim != 1:
        raise ValueError(f'An action has shape ({ACTION_SIZE},), got {array.shape}.')
    if array.dtype.kind not in 'fiu':
        raise ValueError(f'An action is an array of floats, got dtype {array.dtype}.')
    if not np.isfinite(array).all():
        raise ValueError(f'An action must be finite, got {array.tolist()}.')
    return np.clip(array, -1, 1)


def check_max_episode_steps(max_episode_steps: int | None) -> None:
    """Raises `ValueError` if `max_episode_steps` is neither None nor a positive integer."""
    if max_episode_steps is None:
        return
    is_integer = isinstance(max_episode_steps, (int, np.integer))
    if isinstance(max_episode_steps, bool) or not is_integer or max_episode_steps < 1:
        raise ValueError(
            'max_episode_steps must be a positive integer, or None for episodes that never '
            f'end; got {max_episode_steps!r}.'
        )
