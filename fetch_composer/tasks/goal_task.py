"""A goal-conditioned manipulation task for the Fetch, of which Push and its kin are instances."""

import collections
import functools
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from dm_control.composer import variation
from dm_env import specs

from fetch_composer import entities
from fetch_composer.tasks import (
    conventions,
    drive,
    object_shapes,
    observation,
    pixels,
    scene,
    seeding,
    starts,
)
from fetch_composer.tasks import state as state_lib
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.goal_conditioned import GoalConditionedTask
from fetch_composer.tasks.goal_scene import GoalScene
from fetch_composer.tasks.observables import FreshObservable
from fetch_composer.tasks.options import TaskOptions
from fetch_composer.tasks.settled import SettledState
from fetch_composer.tasks.variations import Variations

CONTROL_TIMESTEP = 0.04  # s, 25 Hz.
PHYSICS_TIMESTEP = 0.002  # s


class GoalTask(GoalConditionedTask):
    """Move the gripper by small displacements so that a goal is achieved, and keep it so.

    A subclass names its workspace, brings its objects and says how starts and goals are sampled.

    Attributes:
        name: Name under which the task is registered.
        identity: What a state must share with it, once it is compiled.
        instruction: What one would tell a robot to do, in words.
        conventions: Names of the conventions that it has.
        convention: The choices that its convention makes.
        workspace: Where things are.
        scene: Its entities.
        starts: Where its episodes start.
        variations: What differs between episodes beyond start and goal.
        random: What the environment draws from, as the tasks of dm_control's suite have it.
    """

    name = 'unregistered'
    instruction = 'reach the red mark'
    conventions: tuple[str, ...] = (conventions.DOCUMENTED.name,)
    random: np.random.RandomState | None = None

    def __init__(
        self,
        options: TaskOptions,
        workspace: scene.Workspace,
        objects: Sequence[entities.Block] = (),
        obstacles: Sequence[entities.Obstacle] = (),
        locked_gripper: bool = True,
        settled: SettledState | None = None,
    ) -> None:
        """Initializes the task.

        Args:
            options: What was chosen.
            workspace: Where things are.
            objects: What is to be at the goal, each at a place of its own; if there is nothing,
                the gripper itself.
            obstacles: What stands fixed on the table.
            locked_gripper: Whether the gripper stays closed.
            settled: Where Gymnasium-Robotics starts this very task, of at most one object; needed
                for its convention.

        Raises:
            ValueError: if an option is not valid for this task; the message says what would be.
        """
        self.convention = conventions.CONVENTIONS[options.convention]
        if options.convention not in self.conventions:
            raise ValueError(
                f'The task {self.name!r} has no convention {options.convention!r}; '
                f'valid are {", ".join(self.conventions)}.'
            )
        self.workspace = workspace
        self.locked_gripper = locked_gripper
        self._settled = settled
        self._raised = object_shapes.reshape(objects, options)
        self.scene = scene.Scene(
            workspace, self.convention, objects, obstacles, locked_gripper, options.mode
        )
        super().__init__(options, self.scene.num_goals)
        self.set_timesteps(control_timestep=CONTROL_TIMESTEP, physics_timestep=PHYSICS_TIMESTEP)
        self._task_observables = self._build_task_observables()
        self.variations = Variations(
            options.variations, self.scene, fixed_start=self.convention.settled_start
        )
        self.starts = starts.EpisodeStarts(
            self.scene,
            self.grip_start,
            self.object_heights,
            *self._build_samplers(),
            self.variations,
            self._raised_goal,
            settled if self.convention.settled_start else None,
        )
        self.starts.fix(self.starts.check(options.object_position, options.goal))
        self._next_episode = self._start = starts.Start()

    def _build_samplers(self) -> tuple[variation.Variation | None, variation.Variation]:
        """Returns what samples the objects' x and y (None without any) and the desired goal.

        They are drawn in the order of the objects: (2 n,) and (3 n,) numbers in m.
        """
        raise NotImplementedError

    def _raised_goal(self, goal: np.ndarray, raised: np.ndarray) -> np.ndarray:
        """Returns a drawn goal, (3 n,) in m, for objects of another height.

        Args:
            goal: (3 n,) for the usual ones.
            raised: (n,) by how many m the centre of each rests higher than usual.
        """
        places = goal.reshape(-1, 3) + raised[:, np.newaxis] * (0.0, 0.0, 1.0)
        return places.reshape(-1)

    def _build_task_observables(self):
        observables = collections.OrderedDict(
            observation=FreshObservable(lambda: self._observer.observation()),
            achieved_goal=FreshObservable(lambda: self._observer.achieved_goal()),
            desired_goal=FreshObservable(lambda: self._goal.position),
        )
        for each in observables.values():
            each.enabled = True
        self._goal_scene: GoalScene | None = None
        pictures = pixels.observables(
            self.scene.arena.mjcf_model,
            pixels.options(self.options.pixels),
            goal_scene=self._made_goal_scene,
            start=lambda: self._start,
        )
        observables['observation'].enabled = self.options.observation_mode != 'pixels'
        if self.options.observation_mode != 'features':
            observables.update(pictures)
        return observables

    def _made_goal_scene(self) -> GoalScene:
        assert self._goal_scene is not None, 'It is made once the model is compiled.'
        return self._goal_scene

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
            assert self._settled is not None, 'Its convention starts where it has settled.'
            return self._settled.grip_position
        grip_ahead = self.scene.gripper.tool_center_point.pos[0]  # The gripper points down.
        return np.array(self.workspace.gripper_position) - (0, 0, grip_ahead)

    @property
    def object_heights(self) -> tuple[float, ...]:
        """Height in m at which the centre of each object rests on the table."""
        if self._settled is not None and self._settled.object_height is not None:
            (raised,) = self._raised
            return (self._settled.object_height + raised,)
        return tuple(self.workspace.table_top + each.half_height for each in self.scene.objects)

    @property
    def object_height(self) -> float | None:
        """That of the first object; None without one."""
        return next(iter(self.object_heights), None)

    def set_next_episode(
        self,
        object_position: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
    ) -> None:
        """Gives the start or the goal of the next episode, and of that one only.

        Whatever is not given is sampled, and is the same as if nothing had been given.

        Args:
            object_position: (2,) x and y in m at which the object starts; (2 n,) for n objects.
            goal: (3,) desired goal in m; (3 n,) for n objects.

        Raises:
            ValueError: if a place cannot be; nothing has changed.
        """
        self._next_episode = self.starts.check(object_position, goal)

    # -- Composer's hooks ----------------------------------------------------------------------

    def after_compile(self, physics, random_state) -> None:
        del random_state  # Unused.
        model, data = physics.model.ptr, physics.data.ptr
        self._model, self._data = model, data
        self.addresses = Addresses.of(self.scene, physics)
        bind = functools.partial(getattr, data)
        self._drive = drive.Drive(bind, self.addresses, self.options, self.locked_gripper)
        self._observer = observation.GoalObserver(
            model,
            data,
            self.addresses,
            self.control_timestep,
            self.convention.object_minus_gripper,
            current=self._drive.observes_current_state,
        )
        self.variations.compile(physics)
        self._varied = self.variations.fields(functools.partial(getattr, model))
        self._goal.compile(model, self.addresses, self._observer)
        meshes = [physics.bind(each.mesh).element_id for each in self.scene.objects if each.mesh]
        self.identity = state_lib.identity(
            self.name,
            self.options,
            model,
            self.scene.num_goals,
            len(self.scene.drawn_props),
            meshes,
        )
        self._start = starts.Start(prop_position=np.zeros(2 * len(self.scene.drawn_props)))
        self.starts.compile(physics, self.addresses)
        self.close()
        if any(
            isinstance(each, pixels.GoalCameraObservable) for each in self.task_observables.values()
        ):
            self._goal_scene = GoalScene(
                physics, self.scene, self.addresses, self.starts, self.variations,
                self.locked_gripper,
            )  # fmt: skip

    def close(self) -> None:
        """Frees what the task has made beside the simulation of its environment."""
        if self._goal_scene is not None:
            self._goal_scene.physics.free()
            self._goal_scene = None

    def initialize_episode(self, physics, random_state) -> None:
        try:
            start = self.starts.draw(random_state, self._next_episode)
        except ValueError:
            self._next_episode = starts.Start()  # What was given was for this one alone.
            raise
        if start.variations:
            self._vary(physics, start.variations)
        state = self.starts.state(start)
        self._start, self._next_episode = start, starts.Start()
        self._steps_taken = 0
        self._drive.place(state)
        assert start.goal is not None, 'One is drawn.'
        self._goal.set(start.goal)
        self._goal.show(achieved=False)

    def _vary(self, physics, values: Mapping[str, np.ndarray]) -> None:
        self.variations.write(values, self._varied)
        if self.variations.need_set_const:
            # Computed by the way, these would move the far plane of every camera.
            extent, centre = self._model.stat.extent, self._model.stat.center.copy()
            mujoco.mj_setConst(self._model, self._data)
            self._model.stat.extent, self._model.stat.center[:] = extent, centre
        physics.reset()  # Neither leaves the state as it was.

    def get_state(self, random_state: np.random.RandomState, is_over: bool) -> state_lib.State:
        """Returns the state; see `Environment.get_state`."""
        return state_lib.State(
            **self.identity.names,
            physics=state_lib.get_physics(self._model, self._data),
            gripper_pose=self._drive.gripper_pose(),
            goal=self._goal.position,
            prop_position=self._start.prop_position.copy(),
            steps_taken=self._steps_taken,
            is_over=is_over,
            variations=state_lib.copied(self._start.variations),
            given=self._next_episode.given(),
            generator=random_state.get_state(legacy=False),
        )

    def check_state(self, state: state_lib.State, random_state: np.random.RandomState) -> None:
        """Raises `ValueError`, which says what differs, if a state does not fit."""
        self.identity.check(state)
        self.starts.check_restored(state.variations, state.given, state.has_begun)
        seeding.check_generator(random_state, state.generator)

    def set_state(
        self, physics, state: state_lib.State, random_state: np.random.RandomState
    ) -> None:
        """Restores a state; see `Environment.set_state`."""
        self.check_state(state, random_state)
        if state.variations:
            self._vary(physics, state.variations)
        self._goal.set(state.goal)  # Before the physics, which puts the target there.
        state_lib.set_physics(self._model, self._data, state.physics)
        if self._drive.set_gripper_pose(state.gripper_pose):
            drive.fall_behind(self._model, self._data)
            mujoco.mj_camlight(self._model, self._data)
        self._start = starts.Start(
            goal=self._goal.position,
            variations=state_lib.copied(state.variations),
            prop_position=state.prop_position.copy(),
        )
        self._next_episode = starts.Start.of(state.given)
        self._goal.show(self.visualize_reward and self.is_success())
        self._steps_taken = state.steps_taken
        random_state.set_state(dict(state.generator))

    def before_step(self, physics, action, random_state) -> None:
        del physics, random_state  # Unused.
        action = self._drive.clip(action)
        self._steps_taken += 1
        self._drive.act(action)

    def after_step(self, physics, random_state) -> None:
        del physics, random_state  # Unused.
        self._drive.relock()
        if self._drive.observes_current_state:
            drive.refresh(self._model, self._data)
            mujoco.mj_camlight(self._model, self._data)
        if self.visualize_reward:
            self._goal.show(self.is_success())

    def action_spec(self, physics) -> specs.BoundedArray:
        del physics  # Unused.
        return self.options.mode.spec
