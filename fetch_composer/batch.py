"""Many environments of one task, advanced together on native threads."""

import os
from collections.abc import Sequence

import dm_env
import mujoco
import mujoco.batch
import numpy as np
from dm_control.rl import control
from dm_env import specs

from fetch_composer import tasks
from fetch_composer.environment import Environment, SeededRandomState
from fetch_composer.tasks import actions as actions_lib
from fetch_composer.tasks import goal_task, observation, rewards, starts


def num_processors() -> int:
    """Returns how many processors this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class BatchEnvironment:
    """`num_envs` environments whose time steps are arrays of shape (num_envs, ...).

    Environment i of a batch seeded with s is the single environment seeded with s + i: same
    starts, same trajectories, same observations, over any number of episodes.

    An environment whose episode has ended starts its next one in the following call of `step`,
    which ignores its action and gives it a time step of type FIRST, as `dm_env` has it. Such
    rows have reward 0 and discount 1.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        num_threads: int | None = None,
        seed: int | Sequence[int | None] | None = None,
        **task_kwargs,
    ) -> None:
        """Initializes the batch.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            num_envs: How many environments, at least 1.
            num_threads: Threads that share them; by default one for each processor.
            seed: As for the method `seed`.
            **task_kwargs: Options of the task; see `tasks.GoalTask`.

        Raises:
            ValueError: if a name, an option or a number is not valid; the message says what is.
        """
        self._num_envs = _check_count('num_envs', num_envs)
        if num_threads is None:
            num_threads = min(num_processors(), num_envs)
        self._num_threads = _check_count('num_threads', num_threads)
        if num_threads > num_envs:
            raise ValueError(
                f'num_threads ({num_threads}) must not exceed num_envs ({num_envs}): '
                'a thread without an environment has nothing to do.'
            )
        self._task = tasks.make(task, **task_kwargs)
        if set(self._task.task_observables) != {'observation', 'achieved_goal', 'desired_goal'}:
            raise ValueError(
                "A batch renders no pictures: use observation_mode='features', or single "
                'environments.'
            )
        # Nobody sees a batch, and what can be seen takes time as well.
        self._task.scene.remove_looks(cameras=not self._task.variations.vary_looks)
        # The single environment compiles the model and has the specs.
        self._single = Environment(self._task, random_state=0)
        self._addresses = self._task.addresses
        model = self._single.physics.model.ptr
        self._sims = mujoco.batch.Batch(model, num_envs, nthread=num_threads)
        self._bind(model)
        self.seed(seed)
        self._goals = np.zeros((num_envs, 3))
        self._steps_taken = np.zeros(num_envs, dtype=np.int64)
        self._reset_next_step: np.ndarray = np.ones(num_envs, dtype=bool)

    def _bind(self, model: mujoco.MjModel) -> None:
        """Keeps live arrays over what the batch reads and writes."""
        sims, addresses = self._sims, self._addresses
        self._qpos, self._qvel = sims.bind('qpos'), sims.bind('qvel')
        self._mocap_position = sims.bind('mocap_pos')[:, addresses.mocap]
        self._mocap_quaternion = sims.bind('mocap_quat')[:, addresses.mocap]
        self._control = sims.bind('ctrl')
        # What varies in each environment; nothing is seen of the rest, for want of pictures.
        varied = self._task.variations.fields(physical_only=True)
        self._fields = {name: sims.expand(name) for name in varied}
        self._gripper_position = sims.bind('xpos')[:, addresses.gripper_link]
        self._gripper_quaternion = sims.bind('xquat')[:, addresses.gripper_link]
        self._observer = observation.BatchObserver(
            model,
            sims,
            addresses,
            control_timestep=goal_task.CONTROL_TIMESTEP,
            block_minus_gripper=self._task.convention.block_minus_gripper,
        )
        current = self._task.observes_current_state
        stages = mujoco.mjtStage
        self._stage = stages.mjSTAGE_POS if current else stages.mjSTAGE_NONE

    @property
    def num_envs(self) -> int:
        """How many environments there are."""
        return self._num_envs

    @property
    def num_threads(self) -> int:
        """How many threads share the environments."""
        return self._num_threads

    @property
    def task(self) -> tasks.GoalTask:
        """The task that all environments have in common."""
        return self._task

    def seed(self, seed: int | Sequence[int | None] | None) -> None:
        """Seeds every environment anew; its current episode goes on.

        Args:
            seed: Seed of the first environment, after which the others' count up; or one seed
                for each; or None for entropy.
        """
        if seed is None or isinstance(seed, (int, np.integer)):
            seeds = [None if seed is None else int(seed) + i for i in range(self._num_envs)]
        else:
            seeds = list(seed)
            if len(seeds) != self._num_envs:
                raise ValueError(f'{self._num_envs} seeds are needed, got {len(seeds)}.')
        self._random_states = [SeededRandomState(each) for each in seeds]

    def reset(self, object_position=None, goal=None) -> dm_env.TimeStep:
        """Starts a new episode in every environment.

        Args:
            object_position: (2,) or (num_envs, 2) x and y in m at which objects start.
            goal: (3,) or (num_envs, 3) desired goals in m.

        Raises:
            ValueError: if a place cannot be; nothing has changed.
        """
        return self.start_episodes(self.check_starts(object_position, goal))

    def check_starts(self, object_position=None, goal=None) -> list[starts.Start]:
        """Returns the given places for each environment; see `reset`."""
        return [
            self._task.check_start(*each)
            for each in zip(
                self._each('object_position', object_position, 2),
                self._each('goal', goal, 3),
                strict=True,
            )
        ]

    def start_episodes(self, given: Sequence[starts.Start]) -> dm_env.TimeStep:
        """Starts a new episode in every environment from what `check_starts` returned."""
        self._start_episodes(np.arange(self._num_envs), given)
        return self._time_step(np.full(self._num_envs, dm_env.StepType.FIRST))

    def _each(self, name: str, places, size: int) -> list:
        """Returns one place, or None, for each environment."""
        if places is None:
            return [None] * self._num_envs
        array = np.asarray(places, dtype=np.float64)
        if array.shape not in ((size,), (self._num_envs, size)):
            raise ValueError(
                f'{name} must have shape ({size},) or ({self._num_envs}, {size}), '
                f'got {array.shape}.'
            )
        return list(np.broadcast_to(array, (self._num_envs, size)))

    def _start_episodes(self, ids: np.ndarray, given: Sequence[starts.Start]) -> None:
        drawn = [
            self._task.sample_start(self._random_states[i], each)
            for i, each in zip(ids, given, strict=True)
        ]
        states = [self._task.start_state(start) for start in drawn]
        self._vary(ids, drawn)
        self._sims.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._qpos[ids] = [state.qpos for state in states]
        self._qvel[ids] = [state.qvel for state in states]
        self._mocap_position[ids] = [state.mocap_position for state in states]
        self._mocap_quaternion[ids] = [state.mocap_quaternion for state in states]
        self._sims.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS)
        self._goals[ids] = [start.goal for start in drawn]
        self._steps_taken[ids] = 0
        self._reset_next_step[ids] = False

    def _vary(self, ids: np.ndarray, drawn: Sequence[starts.Start]) -> None:
        """Gives environments the physics that was drawn for them."""
        if not self._fields:
            return
        for i, start in zip(ids, drawn, strict=True):
            physical = self._task.variations.physical(start.variations)
            row = {name: field[i] for name, field in self._fields.items()}
            self._task.variations.write(physical, row.__getitem__)
        if self._task.variations.need_set_const:
            self._sims.set_const(ids)

    def step(self, actions) -> dm_env.TimeStep:
        """Advances every environment by one control step.

        Args:
            actions: (num_envs, 4), each as for the single environment.

        Returns:
            A `dm_env.TimeStep` of arrays: `step_type`, `reward` and `discount` of shape
            (num_envs,), and a dict of observations of shape (num_envs, ...).

        Raises:
            ValueError: if an action is not valid; no environment has moved.
            PhysicsError: if the physics of an environment diverges; the message names which.
        """
        actions = actions_lib.clip(actions, (self._num_envs,))
        finished = self._reset_next_step
        if finished.any():
            ids = np.flatnonzero(finished)
            running = np.flatnonzero(~finished)
            self._start_episodes(ids, [starts.Start()] * len(ids))
            if len(running):
                self._advance(actions, running)
            first = np.zeros(self._num_envs, dtype=bool)
            first[ids] = True
        else:
            self._advance(actions, None)
            first = None
        limit = self._task.max_episode_steps
        step_type = np.full(self._num_envs, dm_env.StepType.MID)
        if limit is not None:
            self._reset_next_step = self._steps_taken >= limit
            step_type[self._reset_next_step] = dm_env.StepType.LAST
        if first is not None:
            step_type[first] = dm_env.StepType.FIRST
        return self._time_step(step_type)

    def _advance(self, actions: np.ndarray, ids: np.ndarray | None) -> None:
        """Advances some environments; None for all, which needs no copies."""
        rows = slice(None) if ids is None else ids
        displacement = actions[rows, :3] * actions_lib.METRES_PER_UNIT
        self._mocap_position[rows] = self._gripper_position[rows] + displacement
        if self._task.convention.additive_rotation:
            self._mocap_quaternion[rows] = (
                self._gripper_quaternion[rows] + actions_lib.ADDED_ROTATION
            )
        if not self._task.locked_gripper:
            fingers = self._qpos[rows][:, self._addresses.finger_qpos]
            self._control[rows] = fingers + actions[rows, 3:]
        substeps = self._task.physics_steps_per_control_step
        if self._task.loose_fingers:
            self._sims.step(ids, nstep=substeps)
            if ids is None:
                self._qpos[:, self._addresses.finger_qpos] = 0
            else:
                self._qpos[ids[:, np.newaxis], self._addresses.finger_qpos] = 0
            self._sims.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS)
        else:
            self._sims.step(ids, nstep=substeps, stage=self._stage)
        self._steps_taken[rows] += 1
        warnings = self._sims.warning[..., 1]  # How often each kind was raised.
        if warnings.any():
            diverged = np.flatnonzero(warnings.any(axis=-1)).tolist()
            warnings[:] = 0
            raise control.PhysicsError(f'Physics diverged in environments {diverged}.')

    def _time_step(self, step_type: np.ndarray) -> dm_env.TimeStep:
        achieved_goal = self._observer.achieved_goal()
        reward = rewards.compute_reward(achieved_goal, self._goals, self._task.reward_type)
        reward[step_type == dm_env.StepType.FIRST] = 0
        return dm_env.TimeStep(
            step_type=step_type,
            reward=reward,
            discount=np.ones(self._num_envs),
            observation={
                'observation': self._observer.observation(),
                'achieved_goal': achieved_goal,
                'desired_goal': self._goals.copy(),
            },
        )

    def single_action_spec(self) -> specs.BoundedArray:
        """Returns the spec of one environment's action, shape (4,)."""
        return self._single.action_spec()

    def single_observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of one environment's observations."""
        return self._single.observation_spec()

    def action_spec(self) -> specs.BoundedArray:
        """Returns the spec of `step`'s argument, shape (num_envs, 4)."""
        return self._batched(self.single_action_spec())

    def observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of a time step's observations."""
        single = self.single_observation_spec()
        return {name: self._batched(spec) for name, spec in single.items()}

    def reward_spec(self) -> specs.Array:
        """Returns the spec of a time step's reward, shape (num_envs,)."""
        return self._batched(self._single.reward_spec())

    def discount_spec(self) -> specs.Array:
        """Returns the spec of a time step's discount, shape (num_envs,)."""
        return self._batched(self._single.discount_spec())

    def _batched(self, spec: specs.Array) -> specs.Array:
        return spec.replace(shape=(self._num_envs, *spec.shape))

    def close(self) -> None:
        """Frees the simulations; the batch cannot be used afterwards."""
        self._single.close()
        del self._sims

    def __enter__(self) -> 'BatchEnvironment':
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()


def _check_count(name: str, count: int) -> int:
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
        raise ValueError(f'{name} must be a positive integer, got {count!r}.')
    return int(count)
