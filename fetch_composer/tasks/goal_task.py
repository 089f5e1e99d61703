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
ADDED_ROTATION = np.array((1.0, 0.0, 1.0, 0.0))

# Configuration from which inverse kinematics starts, shoulder to wrist in rad: elbow up, near
# the pose in which Gymnasium-Robotics settles.
_ELBOW_UP = (0.01, -0.83, 0.0, 1.44, 0.0, 0.95, 0.0)
_START_TOLERANCE = 1e-12  # Of the inverse kinematics, in m and rad.
_MAX_START_ERROR = 1e-5  # m


@dataclasses.dataclass(frozen=True)
class Addresses:
    """Where things are in the compiled model, so that names are looked up once.

    Attributes:
        gripper_link: Id of the body that is welded to the mocap body.
        mocap: Index of the mocap body.
        target: Id of the target's body.
        grip_site: Id of the gripper's observed site.
        object_site: Id of the object's observed site, or None.
        arm_qpos: (7,) positions of the arm's joints in qpos.
        finger_qpos: (2,) of the right and left finger's joint in qpos; empty if rigid.
        finger_qvel: (2,) the same in qvel.
        object_qpos: The object's pose in qpos; empty without one.
        object_qvel: The object's velocity in qvel; empty without one.
    """

    gripper_link: int
    mocap: int
    target: int
    grip_site: int
    object_site: int | None
    arm_qpos: np.ndarray
    finger_qpos: np.ndarray
    finger_qvel: np.ndarray
    object_qpos: slice
    object_qvel: slice


@dataclasses.dataclass(frozen=True)
class Start:
    """What differs between the starts of two episodes.

    Attributes:
        block_position: (2,) x and y in m at which the object starts; None without one.
        goal: (3,) desired goal in m.
    """

    block_position: np.ndarray | None = None
    goal: np.ndarray | None = None


@dataclasses.dataclass(frozen=True)
class RestState:
    """What all starts share: (nq,) qpos, (nv,) qvel and the pose of the mocap body."""

    qpos: np.ndarray
    qvel: np.ndarray
    mocap_position: np.ndarray
    mocap_quaternion: np.ndarray


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
        self._every_episode = self.check_start(block_position, goal)
        self._next_episode = Start()

        self._goal = np.zeros(3)
        self._steps_taken = 0
        self._arm_start: np.ndarray | None = None

    def _build_samplers(self) -> tuple[variation.Variation | None, variation.Variation]:
        """Returns what samples the object's x and y (None without one) and the desired goal."""
        raise NotImplementedError

    def _build_task_observables(self):
        observables = collections.OrderedDict(
            observation=observable.Generic(lambda _: self._observer.observation()),
            achieved_goal=observable.Generic(lambda _: self._observer.achieved_goal()),
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
        self._next_episode = self.check_start(block_position, goal)

    def check_start(self, block_position=None, goal=None) -> Start:
        """Returns the given places as a `Start`, with None for what is not given.

        Raises:
            ValueError: if a place cannot be.
        """
        if block_position is not None:
            if self.scene.block is None:
                raise ValueError(f'block_position was given, but {self.name!r} has no object.')
            block_position = self.workspace.check_block_position(block_position)
        if goal is not None:
            goal = self.workspace.check_goal(goal)
        return Start(block_position, goal)

    def sample_start(
        self,
        random_state: np.random.RandomState,
        given: Start = Start(),  # noqa: B008
    ) -> Start:
        """Draws where an episode starts and what its goal is.

        Everything is drawn, given or not, so that giving one place leaves the other as it was.

        Args:
            random_state: What to draw from.
            given: Places that override the task's own and the drawn ones.
        """
        drawn = Start(
            self._block_placer and self._block_placer(random_state=random_state),
            self._goal_sampler(random_state=random_state),
        )
        sources = (given, self._every_episode, drawn)
        return Start(
            next((s.block_position for s in sources if s.block_position is not None), None),
            next(s.goal for s in sources if s.goal is not None),
        )

    # -- Composer's hooks ----------------------------------------------------------------------

    def after_compile(self, physics, random_state) -> None:
        del random_state  # Unused.
        model, data = physics.model.ptr, physics.data.ptr
        self._model, self._data = model, data
        self.addresses = addresses = self._resolve(physics)
        self._gripper_position = data.xpos[addresses.gripper_link]
        self._gripper_quaternion = data.xquat[addresses.gripper_link]
        self._mocap_position = data.mocap_pos[addresses.mocap]
        self._mocap_quaternion = data.mocap_quat[addresses.mocap]
        self._observer = observation.GoalObserver(
            model,
            data,
            grip_site=addresses.grip_site,
            finger_qpos=addresses.finger_qpos,
            finger_qvel=addresses.finger_qvel,
            object_site=addresses.object_site,
            control_timestep=CONTROL_TIMESTEP,
            block_minus_gripper=self.convention.block_minus_gripper,
        )
        if self.convention.settled_start:
            self.rest_state = self._settled_state()
        else:
            self.rest_state = self._documented_state(physics)

    def initialize_episode(self, physics, random_state) -> None:
        del physics  # Written to through views.
        start = self.sample_start(random_state, self._next_episode)
        self._next_episode = Start()
        self._steps_taken = 0
        self._goal = np.array(start.goal)
        self._data.qpos[:] = self.rest_state.qpos
        self._data.qvel[:] = self.rest_state.qvel
        if start.block_position is not None:
            self._data.qpos[self.addresses.object_qpos][:2] = start.block_position
        self._mocap_position[:] = self.rest_state.mocap_position
        self._mocap_quaternion[:] = self.rest_state.mocap_quaternion
        self._model.body_pos[self.addresses.target] = self._goal

    def before_step(self, physics, action, random_state) -> None:
        del physics, random_state  # Unused.
        action = clip_action(action)
        self._steps_taken += 1
        self._mocap_position[:] = self._gripper_position + action[:3] * METRES_PER_UNIT
        if self.convention.additive_rotation:
            self._mocap_quaternion[:] = self._gripper_quaternion + ADDED_ROTATION
        if not self.locked_gripper:
            self._data.ctrl[:] = self._data.qpos[self.addresses.finger_qpos] + action[3]

    def after_step(self, physics, random_state) -> None:
        del physics, random_state  # Unused.
        if self.locked_gripper:
            self._data.qpos[self.addresses.finger_qpos] = 0
        if self.observes_current_state:
            # `mj_step` leaves positions and velocities one substep behind the state.
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_comVel(self._model, self._data)
            mujoco.mj_camlight(self._model, self._data)

    @property
    def observes_current_state(self) -> bool:
        """Whether positions are observed at the state, or one substep late as the peer does."""
        return self.locked_gripper or self.convention.refresh_unlocked

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
        achieved_goal = self._observer.achieved_goal()
        return float(rewards.compute_reward(achieved_goal, self._goal, self.reward_type))

    def is_success(self) -> bool:
        """Returns whether the goal is achieved now: whether it is less than 0.05 m away."""
        return bool(rewards.is_success(self._observer.achieved_goal(), self._goal))

    def should_terminate_episode(self, physics) -> bool:
        del physics  # Unused.
        return self.max_episode_steps is not None and self._steps_taken >= self.max_episode_steps

    def get_discount(self, physics) -> float:
        del physics  # Unused.
        return 1.0

    # -- The compiled model --------------------------------------------------------------------

    def _resolve(self, physics) -> Addresses:
        scene, model = self.scene, physics.model.ptr
        fingers = [physics.bind(joint).element_id for joint in scene.gripper.joints]
        object_qpos = object_qvel = slice(0)
        object_site = None
        if scene.block is not None:
            joint = physics.bind(scene.block_joint).element_id
            qpos, qvel = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
            object_qpos, object_qvel = slice(qpos, qpos + 7), slice(qvel, qvel + 6)
            object_site = physics.bind(scene.block.site).element_id
        return Addresses(
            gripper_link=physics.bind(scene.gripper.gripper_link).element_id,
            mocap=model.body_mocapid[model.body(scene.mocap_frame.full_identifier).id],
            target=model.body(scene.target_frame.full_identifier).id,
            grip_site=physics.bind(scene.gripper.tool_center_point).element_id,
            object_site=object_site,
            arm_qpos=model.jnt_qposadr[physics.bind(scene.arm.joints).element_id],
            finger_qpos=model.jnt_qposadr[fingers],
            finger_qvel=model.jnt_dofadr[fingers],
            object_qpos=object_qpos,
            object_qvel=object_qvel,
        )

    def _documented_state(self, physics) -> RestState:
        """Returns the state at rest with the gripper at its documented pose."""
        if self._arm_start is None:
            self._arm_start = self._solve_inverse_kinematics(physics)
        qpos = self._model.qpos0.copy()
        qpos[self.addresses.arm_qpos] = self._arm_start
        if self.scene.block is not None:
            block_qpos = qpos[self.addresses.object_qpos]
            block_qpos[2] = self.object_height
            block_qpos[3:] = self.scene.block.quaternion
        return RestState(
            qpos=qpos,
            qvel=np.zeros(self._model.nv),
            mocap_position=np.array(self.workspace.gripper_position),
            mocap_quaternion=np.array(conventions.POINTING_DOWN),
        )

    def _solve_inverse_kinematics(self, physics) -> np.ndarray:
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
        return result.qpos[self.addresses.arm_qpos]

    def _settled_state(self) -> RestState:
        """Returns the state in which the peer has settled."""
        model, state = self._model, conventions.settled_state(self.name)
        qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
        scene = self.scene
        for joint in (*scene.arm.base_joints, *scene.arm.joints, *scene.gripper.joints):
            index = model.joint(joint.full_identifier).id
            qpos[model.jnt_qposadr[index]] = state.qpos[joint.name]
            qvel[model.jnt_dofadr[index]] = state.qvel[joint.name]
        if scene.block is not None:
            qpos[self.addresses.object_qpos] = state.object_qpos
            qvel[self.addresses.object_qvel] = state.object_qvel
        # The peer leaves its mocap body at the origin until the first action moves it.
        return RestState(qpos, qvel, np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0)))


def clip_action(action, batch_shape: tuple[int, ...] = ()) -> np.ndarray:
    """Returns the action with each component clipped to [-1, 1], in its own precision.

    Args:
        action: (*batch_shape, 4) displacement of the gripper along x, y and z in units of
            0.05 m, and the opening of its fingers.
        batch_shape: () for one action.

    Raises:
        ValueError: if it has another shape or is not finite.
    """
    array = np.asarray(action)
    shape = (*batch_shape, ACTION_SIZE)
    if array.shape != shape:
        raise ValueError(f'An action of shape {shape} is needed, got {array.shape}.')
    if array.dtype.kind not in 'fiu':
        raise ValueError(f'An action of floats is needed, got dtype {array.dtype}.')
    if not np.isfinite(array).all():
        if batch_shape:
            rows = np.flatnonzero(~np.isfinite(array).all(axis=-1)).tolist()
            raise ValueError(f'Actions must be finite; rows {rows} are not.')
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
