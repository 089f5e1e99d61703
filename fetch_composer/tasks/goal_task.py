"""A goal-conditioned manipulation task for the Fetch, of which Push and its kin are instances."""

import collections
import dataclasses
import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from dm_control import composer
from dm_control.composer import variation
from dm_control.composer.observation import observable
from dm_env import specs

from fetch_composer import entities
from fetch_composer.tasks import (
    actions,
    conventions,
    observation,
    rewards,
    scene,
    starts,
)
from fetch_composer.tasks import pixels as pixels_lib
from fetch_composer.tasks import variations as variations_lib
from fetch_composer.tasks.addresses import Addresses

CONTROL_TIMESTEP = 0.04  # s, 25 Hz.
PHYSICS_TIMESTEP = 0.002  # s
MAX_EPISODE_STEPS = 50

_FINGERTIP_DEPTH = 0.0185  # m, of the fingertips below the observed site.
_GRIPPER_CLEARANCE = 0.1  # m, from a gripper as low as the object.


class GoalTask(composer.Task):
    """Move the gripper by small displacements so that a goal is achieved, and keep it so.

    A subclass names its workspace, brings its object and says how starts and goals are sampled.
    The task is continuing: an episode is only ever truncated, with discount 1.
    """

    def __init__(
        self,
        name: str,
        workspace: scene.Workspace,
        block: entities.Block | None = None,
        locked_gripper: bool = True,
        reward_type: str = 'sparse',
        max_episode_steps: int | None = MAX_EPISODE_STEPS,
        convention: str = 'documented',
        object_position: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
        observation_mode: str = 'features',
        pixels: Mapping | None = None,
        variations: Mapping | None = None,
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
            convention: 'documented' or 'gymnasium_robotics'.
            object_position: (2,) x and y in m at which the object starts in every episode.
            goal: (3,) desired goal in m of every episode.
            observation_mode: 'features' for the vector `observation`, 'pixels' for what cameras
                see in its place, or 'features+pixels' for both.
            pixels: {option: value} of `pixels.PixelOptions`.
            variations: {name: variation} of what differs between episodes; see
                `variations.DESCRIPTIONS`.

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
        # A locked gripper whose fingers slide within a control step, and are put back at its end.
        self.loose_fingers = locked_gripper and not self.convention.rigid_lock
        self.visualize_reward = False
        self.scene = scene.Scene(workspace, self.convention, block, locked_gripper)
        self.set_timesteps(control_timestep=CONTROL_TIMESTEP, physics_timestep=PHYSICS_TIMESTEP)
        self._task_observables = self._build_task_observables(observation_mode, pixels)
        self.variations = variations_lib.Variations(
            variations, self.scene, fixed_start=self.convention.settled_start
        )

        self._block_placer, self._goal_sampler = self._build_samplers()
        self._every_episode = self.check_start(object_position, goal)
        self._next_episode = starts.Start()
        self._goal: np.ndarray = np.zeros(3)
        self._steps_taken = 0

    def _build_samplers(self) -> tuple[variation.Variation | None, variation.Variation]:
        """Returns what samples the object's x and y (None without one) and the desired goal."""
        raise NotImplementedError

    def _build_task_observables(self, observation_mode, pixels):
        pixels_lib.check_observation_mode(observation_mode)
        chosen = pixels_lib.options(pixels)
        observables = collections.OrderedDict(
            observation=observable.Generic(lambda _: self._observer.observation()),
            achieved_goal=observable.Generic(lambda _: self._observer.achieved_goal()),
            desired_goal=observable.Generic(lambda _: self._goal.copy()),
        )
        for each in observables.values():
            each.enabled = True
        observables['observation'].enabled = observation_mode != 'pixels'
        if observation_mode != 'features':
            observables.update(pixels_lib.observables(self.scene.arena.mjcf_model, chosen))
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
        if self.scene.block is None:
            return None
        if self.name in conventions.SETTLED_TASKS:
            return conventions.settled_state(self.name).object_height
        return self.workspace.table_top + self.scene.block.half_height

    def set_next_episode(
        self,
        object_position: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
    ) -> None:
        """Gives the start or the goal of the next episode, and of that one only.

        Whatever is not given is sampled, and is the same as if nothing had been given.

        Args:
            object_position: (2,) x and y of the object in m, on the table.
            goal: (3,) desired goal in m.

        Raises:
            ValueError: if a place cannot be; the task is then unchanged.
        """
        self._next_episode = self.check_start(object_position, goal)

    def check_start(self, object_position=None, goal=None) -> starts.Start:
        """Returns the given places as a `starts.Start`, with None for what is not given.

        Raises:
            ValueError: if a place cannot be.
        """
        if object_position is not None:
            if self.scene.block is None:
                raise ValueError(f'object_position was given, but {self.name!r} has no object.')
            object_position = self.workspace.check_block_position(object_position)
            self._check_clearance(object_position, self.scene.block)
        if goal is not None:
            goal = self.workspace.check_goal(goal)
        return starts.Start(object_position, goal)

    def _check_clearance(self, object_position: np.ndarray, block: entities.Block) -> None:
        """Raises `ValueError` if an object there would be where a low gripper starts."""
        fingertips = self.grip_start[2] - _FINGERTIP_DEPTH
        distance = np.linalg.norm(object_position - self.grip_start[:2])
        top = self.workspace.table_top + 2 * block.half_height
        if fingertips < top and distance < _GRIPPER_CLEARANCE:
            raise ValueError(
                f'object_position {object_position.tolist()} is where the gripper starts: it must '
                f'be at least {_GRIPPER_CLEARANCE} m from '
                f'{self.grip_start[:2].round(4).tolist()}.'
            )

    def sample_start(
        self,
        random_state: np.random.RandomState,
        given: starts.Start = starts.Start(),  # noqa: B008
    ) -> starts.Start:
        """Draws where an episode starts and what its goal is.

        Everything is drawn, given or not, so that giving one place leaves the other as it was.

        Args:
            random_state: What to draw from.
            given: Places that override the task's own and the drawn ones.
        """
        drawn = starts.Start(
            self._block_placer and self._block_placer(random_state=random_state),
            self._goal_sampler(random_state=random_state),
        )
        sources = (given, self._every_episode, drawn)
        return starts.Start(
            next((s.object_position for s in sources if s.object_position is not None), None),
            next(s.goal for s in sources if s.goal is not None),
            self.variations.draw(random_state),
        )

    def start_state(self, start: starts.Start) -> starts.StartState:
        """Returns the state in which an episode with that start begins, its goal aside."""
        state, addresses = self._common_state, self.addresses
        if 'gripper_offset' in start.variations:
            state = self._documented_state(start.variations['gripper_offset'])
        if start.object_position is not None:
            qpos = state.qpos.copy()
            block_qpos = qpos[addresses.object_qpos]
            block_qpos[:2] = start.object_position
            block_qpos[2] += self.variations.raised(start.variations)
            state = dataclasses.replace(state, qpos=qpos)
        return state

    def _documented_state(self, gripper_offset=(0.0, 0.0, 0.0)) -> starts.StartState:
        return starts.documented_state(
            self.scene,
            self._physics,
            self.addresses,
            np.add(self.workspace.gripper_position, gripper_offset),
            self.object_height,
        )

    # -- Composer's hooks ----------------------------------------------------------------------

    def after_compile(self, physics, random_state) -> None:
        del random_state  # Unused.
        model, data = physics.model.ptr, physics.data.ptr
        self._physics, self._model, self._data = physics, model, data
        self.addresses = addresses = Addresses.of(self.scene, physics)
        self.variations.compile(physics)
        self._gripper_position = data.xpos[addresses.gripper_link]
        self._gripper_quaternion = data.xquat[addresses.gripper_link]
        self._mocap_position = data.mocap_pos[addresses.mocap]
        self._mocap_quaternion = data.mocap_quat[addresses.mocap]
        self._target_rgba = model.site_rgba[physics.bind(self.scene.target.site).element_id]
        self._observer = observation.GoalObserver(
            model,
            data,
            addresses,
            control_timestep=CONTROL_TIMESTEP,
            block_minus_gripper=self.convention.block_minus_gripper,
        )
        if self.convention.settled_start:
            self._common_state = starts.settled_state(self.scene, physics, addresses, self.name)
        else:
            self._common_state = self._documented_state()

    def initialize_episode(self, physics, random_state) -> None:
        start = self.sample_start(random_state, self._next_episode)
        if start.variations:
            self._vary(physics, start)
        state = self.start_state(start)
        self._next_episode = starts.Start()
        self._steps_taken = 0
        self._goal = np.array(start.goal)
        self._data.qpos[:] = state.qpos
        self._data.qvel[:] = state.qvel
        self._mocap_position[:] = state.mocap_position
        self._mocap_quaternion[:] = state.mocap_quaternion
        self._model.body_pos[self.addresses.target] = self._goal
        self._target_rgba[:] = entities.target_rgba(achieved=False)

    def _vary(self, physics, start: starts.Start) -> None:
        self.variations.write(start.variations, lambda field: getattr(self._model, field))
        if self.variations.need_set_const:
            # Computed by the way, these would move the far plane of every camera.
            extent, centre = self._model.stat.extent, self._model.stat.center.copy()
            mujoco.mj_setConst(self._model, self._data)
            self._model.stat.extent, self._model.stat.center[:] = extent, centre
        physics.reset()  # Neither leaves the state as it was.

    def before_step(self, physics, action, random_state) -> None:
        del physics, random_state  # Unused.
        action = actions.clip(action)
        self._steps_taken += 1
        self._mocap_position[:] = self._gripper_position + action[:3] * actions.METRES_PER_UNIT
        if self.convention.additive_rotation:
            self._mocap_quaternion[:] = self._gripper_quaternion + actions.ADDED_ROTATION
        if not self.locked_gripper:
            self._data.ctrl[:] = self._data.qpos[self.addresses.finger_qpos] + action[3]

    def after_step(self, physics, random_state) -> None:
        del physics, random_state  # Unused.
        if self.loose_fingers:
            self._data.qpos[self.addresses.finger_qpos] = 0
        if self.observes_current_state:
            # `mj_step` leaves positions and velocities one substep behind the state.
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_comVel(self._model, self._data)
            mujoco.mj_camlight(self._model, self._data)
        if self.visualize_reward:
            self._target_rgba[:] = entities.target_rgba(self.is_success())

    @property
    def observes_current_state(self) -> bool:
        """Whether positions are observed at the state, or one substep late as the peer does."""
        return self.locked_gripper or self.convention.refresh_unlocked

    def action_spec(self, physics) -> specs.BoundedArray:
        del physics  # Unused.
        return actions.SPEC

    def get_reward_spec(self) -> specs.Array:
        if self.reward_type == 'sparse':
            return specs.BoundedArray((), np.float64, minimum=-1, maximum=0, name='reward')
        return specs.BoundedArray((), np.float64, minimum=-np.inf, maximum=0, name='reward')

    def get_reward(self, physics) -> float:
        del physics  # Unused.
        return rewards.reward_of_distance(self._distance(), self.reward_type)

    def is_success(self) -> bool:
        """Returns whether the goal is achieved now: whether it is less than 0.05 m away."""
        return self._distance() < rewards.DISTANCE_THRESHOLD

    def _distance(self) -> float:
        """Returns the distance in m to the desired goal."""
        return math.dist(self._observer.achieved_goal().tolist(), self._goal.tolist())

    def should_terminate_episode(self, physics) -> bool:
        del physics  # Unused.
        return self.max_episode_steps is not None and self._steps_taken >= self.max_episode_steps

    def get_discount(self, physics) -> float:
        del physics  # Unused.
        return 1.0


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
