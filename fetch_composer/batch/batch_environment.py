"""Many environments of one task, advanced together on native threads."""

from collections.abc import Sequence
from typing import Any

import dm_env
import numpy as np
from dm_control.rl import control
from dm_env import specs

from fetch_composer import tasks
from fetch_composer.batch import compiling, simulations
from fetch_composer.batch.episodes import BatchEpisodes
from fetch_composer.batch.face import BatchFace
from fetch_composer.batch.pictures import BatchPictures
from fetch_composer.tasks import checks, rewards, seeding, starts
from fetch_composer.tasks.state import State


class BatchEnvironment(BatchFace):
    """`num_envs` environments whose time steps are arrays of shape (num_envs, ...).

    Environment i of a batch seeded with s is the single environment seeded with s + i: same
    starts, same trajectories, same observations, over any number of episodes.

    An environment whose episode has ended starts its next one in the following call of `step`,
    which ignores its action and gives it a time step of type FIRST, as `dm_env` has it. Such
    rows have reward 0 and discount 1. With `terminate_on_success` episodes end at different times,
    those at their goals with discount 0.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        num_threads: int | None = None,
        seed=None,
        **task_kwargs,
    ) -> None:
        """Initializes the batch.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            num_envs: How many environments, at least 1.
            num_threads: Threads that share them; by default one for each processor.
            seed: As for the method `seed`.
            **task_kwargs: Options of the task; see `tasks.TaskOptions`.

        Raises:
            ValueError: if a name, an option or a number is not valid; the message says what is.
        """
        self._num_envs = checks.integer('num_envs', num_envs, 1)
        if num_threads is None:
            num_threads = min(simulations.num_processors(), self._num_envs)
        self._num_threads = checks.integer('num_threads', num_threads, 1)
        if self._num_threads > self._num_envs:
            raise ValueError(
                f'num_threads ({num_threads}) must not exceed num_envs ({num_envs}): '
                'a thread without an environment has nothing to do.'
            )
        # The task of a simulation that is none of the batch's: it compiles the model, and says
        # where episodes start.
        task_made = tasks.make(task, **task_kwargs)
        self._task_name, self._options = task_made.name, task_made.options
        self._pictures: BatchPictures | None = None
        if self._options.observation_mode != 'features':
            self._pictures = BatchPictures(task, task_kwargs, self._num_envs)
            task_made = tasks.make(task, **{**task_kwargs, 'observation_mode': 'features'})
        self._compiled = compiling.compiled(task_made)
        self._starts, self._num_goals = task_made.starts, task_made.scene.num_goals
        self._episodes = BatchEpisodes(self._num_envs, task_made)
        self._simulations: simulations.Simulations
        if self._num_envs == 1:
            self._simulations = simulations.OneSimulation(self._compiled.physics, task_made)
        else:
            self._simulations = simulations.ManySimulations(
                self._compiled.physics, task_made, self._num_envs, self._num_threads
            )
        self.seed(seed)

    @property
    def num_threads(self) -> int:
        """How many threads share the environments."""
        return self._num_threads

    @property
    def steps_taken(self) -> np.ndarray:
        """(num_envs,) control steps of each environment since its episode started; a copy."""
        self._check_open()
        return self._episodes.steps_taken.copy()

    @property
    def is_over(self) -> np.ndarray:
        """(num_envs,) whether the next step starts another episode; a copy."""
        self._check_open()
        return self._episodes.is_over.copy()

    def seed(self, seed) -> None:
        """Seeds every environment anew; its current episode goes on.

        Args:
            seed: Seed of the first environment, after which the others' count up; or one seed
                for each; or None for entropy.

        Raises:
            ValueError: if a seed is not a non-negative integer or None, or if there is not one
                for each environment; nothing has changed.
        """
        self._check_open()
        self._episodes.seed(seeding.seeds_of_many(seed, self._num_envs))

    def reset(self, ids=None, object_position=None, goal=None, seed=None) -> dm_env.TimeStep:
        """Starts a new episode in every environment, or in some.

        Args:
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.
            object_position: (2,) x and y in m at which objects start, or (n, 2) for n ids; with
                several objects, two numbers for each of them in the place of two.
            goal: (3,) desired goal in m, or (n, 3) for n ids; three numbers for each object.
            seed: If given, those that are reset are seeded first: with the seed of the first
                environment, after which the others' count up, or with one for each environment,
                where None in place of one goes on with its draws.

        Returns:
            A time step of all environments. Those that were not reset have the observation and
            the step type that they had, and reward 0.

        Raises:
            ValueError: if an id, a place or a seed is not valid; nothing has changed. Or if
                variations draw what cannot be, such as a gripper where an object was to start:
                nothing has been drawn or seeded, and the next step starts these episodes.
        """
        self._check_open()
        ids = checks.ids(ids, self._num_envs)
        given = None  # Whatever states have brought.
        if object_position is not None or goal is not None:
            given = [
                self._starts.check(*each)
                for each in zip(
                    checks.places(
                        'object_position', object_position, len(ids), 2 * self._num_goals
                    ),
                    checks.places('goal', goal, len(ids), 3 * self._num_goals),
                    strict=True,
                )
            ]
        seeds = seeding.seeds_of_many(seed, self._num_envs)
        order = np.argsort(ids)  # MuJoCo wants them sorted.
        self._start_episodes(ids[order], given and [given[i] for i in order], seeds)
        return self._time_step(np.zeros(self._num_envs, dtype=bool))

    def _start_episodes(
        self,
        ids: np.ndarray,
        given: Sequence[starts.Start] | None = None,
        seeds: Sequence[int | None] | None = None,
    ) -> None:
        with self._episodes.starting(ids, given, seeds) as drawn:
            self._simulations.start(ids, drawn)
        self._forget_pictures(ids, goals=True)

    def _forget_pictures(self, rows: Any, goals: bool) -> None:
        if self._pictures is not None:
            self._pictures.forget(rows, goals)

    def get_states(self, ids=None) -> list[State]:
        """Returns the states of all environments, or of some, as `Environment.get_state` has them.

        Args:
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.

        Raises:
            ValueError: if an id is not valid.
        """
        self._check_open()
        return [self._state(i) for i in checks.ids(ids, self._num_envs)]

    def _state(self, i: int) -> State:
        return self._episodes.get(i, *self._simulations.get(i))

    def set_states(self, states: Sequence[State], ids=None) -> None:
        """Restores states, each in an environment; the same one may be restored in several.

        Args:
            states: A state for each id.
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.

        Raises:
            ValueError: if an id is not valid, or a state is of another task, model or version;
                nothing has changed.
        """
        self._check_open()
        ids = checks.ids(ids, self._num_envs)
        states = checks.sequence('states', states)
        if len(states) != len(ids):
            raise ValueError(f'{len(ids)} states are needed, got {len(states)}.')
        for i, state in zip(ids, states, strict=True):
            self._episodes.check(i, state)
        order = np.argsort(ids)  # MuJoCo wants them sorted.
        ids, states = ids[order], [states[i] for i in order]
        self._simulations.set(ids, states)
        for i, state in zip(ids, states, strict=True):
            self._episodes.set(i, state)
        self._forget_pictures(ids, goals=True)

    def step(self, actions) -> dm_env.TimeStep:
        """Advances every environment by one control step.

        Args:
            actions: (num_envs, n), each as for the single environment.

        Returns:
            A `dm_env.TimeStep` of arrays: `step_type`, `reward` and `discount` of shape
            (num_envs,), and a dict of observations of shape (num_envs, ...).

        Raises:
            ValueError: if an action is not valid; no environment has moved.
            PhysicsError: if the physics of an environment diverges; the message names which. In
                the next step it starts anew, and the others go on.
        """
        self._check_open()
        actions = self._options.mode.clip(actions, (self._num_envs,))
        running = ~self._episodes.is_over
        if running.all():
            diverged = self._advance(actions, None)
        else:
            self._start_episodes(np.flatnonzero(~running))
            ids = np.flatnonzero(running)
            diverged = self._advance(actions[ids], ids)
        time_step = self._time_step(running)
        if diverged.size:
            # They start anew with the next step, while the others go on.
            self._episodes.end(diverged)
            raise control.PhysicsError(f'Physics diverged in environments {diverged.tolist()}.')
        return time_step

    def _advance(self, actions: np.ndarray, ids: np.ndarray | None) -> np.ndarray:
        """Advances some environments and returns the ids of those whose physics diverge.

        Args:
            actions: (n, size of an action) clipped actions of these environments.
            ids: (n,) which ones; None for all, which needs no copies.
        """
        rows: Any = ... if ids is None else ids
        diverged = self._simulations.advance(actions, ids) if ids is None or len(ids) else ids
        self._episodes.advance(rows)
        self._forget_pictures(rows, goals=False)
        return diverged

    def _time_step(self, advanced: np.ndarray) -> dm_env.TimeStep:
        """Returns a time step; environments that have not advanced get no reward."""
        achieved_goal, goals = self._simulations.achieved_goal(), self._episodes.goals
        reward = rewards.compute_reward(achieved_goal, goals, self._options.reward_type)
        reward[~advanced] = 0
        discount = np.ones(self._num_envs)
        if self._options.terminate_on_success:
            discount[self._episodes.end_at_goal(achieved_goal, advanced)] = 0
        return dm_env.TimeStep(
            step_type=self._episodes.step_type.copy(),
            reward=reward,
            discount=discount,
            observation=self._observation(achieved_goal),
        )

    def _observation(self, achieved_goal: np.ndarray) -> dict[str, np.ndarray]:
        observation = {'achieved_goal': achieved_goal, 'desired_goal': self._episodes.goals.copy()}
        if self._options.observation_mode != 'pixels':
            observation = {'observation': self._simulations.observation(), **observation}
        if self._pictures is not None:
            observation.update(self._pictures.observation(self._state))
        return observation

    def single_action_spec(self) -> specs.BoundedArray:
        """Returns the spec of one environment's action, shape (4,) by default."""
        return self._compiled.action_spec()

    def single_observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of one environment's observations."""
        spec = dict(self._compiled.observation_spec())
        if self._options.observation_mode == 'pixels':
            del spec['observation']
        if self._pictures is not None:
            spec.update(self._pictures.spec())
        return spec

    def reward_spec(self) -> specs.Array:
        """Returns the spec of a time step's reward, shape (num_envs,)."""
        return self._batched(self._compiled.reward_spec())

    def discount_spec(self) -> specs.Array:
        """Returns the spec of a time step's discount, shape (num_envs,)."""
        return self._batched(self._compiled.discount_spec())

    def close(self) -> None:
        """Frees the simulations; closing twice does no harm, and nothing else works afterwards."""
        if not self._is_closed:
            self._compiled.close()
            if self._pictures is not None:
                self._pictures.close()
            del self._simulations
            self._is_closed = True
