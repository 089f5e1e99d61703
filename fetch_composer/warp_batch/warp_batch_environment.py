"""Many environments of one task, advanced together on an accelerator."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import dm_env
import numpy as np
import warp as wp
from dm_env import specs

from fetch_composer import tasks
from fetch_composer.batch.face import BatchFace
from fetch_composer.tasks import checks, seeding
from fetch_composer.tasks.state import State
from fetch_composer.warp_batch import arrays, device_rules, faults, states
from fetch_composer.warp_batch.simulation import Simulation

# Room for contacts and constraints of an environment, by convention and whether fingers are free.
# In the substeps of 300 episodes of random actions, and at the steps of experts, at most 20 and 120
# were needed, or 22 and 134; and in the second convention 22 and 128, or 26 and 151.
_CAPACITIES = {
    ('documented', False): (32, 160),
    ('documented', True): (40, 224),
    ('gymnasium_robotics', False): (32, 192),
    ('gymnasium_robotics', True): (40, 224),
}


class WarpBatchEnvironment(BatchFace):
    """`num_envs` environments on one device, whose time steps are arrays of that device.

    It is used as a `BatchEnvironment` is, and its time steps have the same names and shapes, of
    float32 and int32. What it computes stays on the device: `as_torch`, `as_jax` and `as_numpy`
    take a time step to other libraries. Physics is MuJoCo Warp's, of single precision; so
    environments are not those of a `BatchEnvironment` to the bit, nor are starts and goals, which
    are drawn alike, but on the device, by a generator of its own. Environment i of a batch seeded
    with s draws what environment 0 of a batch seeded with s + i does.

    A device is not waited for. So what goes wrong on it is raised by the first call that finds
    it out: `step` once the device has got so far, `check`, `reset`, `get_states` and `set_states`
    in any case.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        device: str | None = None,
        seed=None,
        nconmax: int | None = None,
        njmax: int | None = None,
        convert: Callable[[dm_env.TimeStep], Any] | None = None,
        **task_kwargs,
    ) -> None:
        """Initializes the batch.

        Args:
            task: Name of the task.
            num_envs: How many environments, at least 1.
            device: Name of a device of Warp, such as 'cuda:0' or 'cpu'; None for the first
                accelerator or, where there is none, the processor.
            seed: As for the method `seed`.
            nconmax: Contacts that there is room for in an environment, on average.
            njmax: Constraints that there is room for in an environment.
            convert: What every time step is returned through: `as_torch`, `as_jax` or `as_numpy`;
                None for Warp's own arrays.
            **task_kwargs: Options of the task: `reward_type`, `max_episode_steps`,
                `terminate_on_success`, `convention`, `object_position` and `goal`.

        Raises:
            ValueError: if a name, an option or a number is not valid; the message says what is.
        """
        self._num_envs = checks.integer('num_envs', num_envs, 1)
        if not (convert is None or callable(convert)):
            raise ValueError(f'convert must be a function or None; got {checks.shown(convert)}.')
        self._device = arrays.device(device)
        task_made = tasks.make(task, **task_kwargs)
        self._task_name, self._options = task_made.name, task_made.options
        device_rules.check_options(self._options, tasks.default_options(task))
        usual = _CAPACITIES[self._options.convention, not task_made.locked_gripper]
        self._nconmax, self._njmax = (
            checks.integer(name, default if given is None else given, 1)
            for name, given, default in zip(
                ('nconmax', 'njmax'), (nconmax, njmax), usual, strict=True
            )
        )
        self._starts, self._num_goals = task_made.starts, task_made.scene.num_goals
        self._simulation = Simulation(
            task_made, self._num_envs, self._device, self._nconmax, self._njmax
        )
        self._states = states.States(task_made, self._simulation)
        self._watch = faults.Watch(self._simulation.faults)
        self._convert = convert or (lambda time_step: time_step)
        self.seed(seed)

    @property
    def device(self) -> str:
        """Name of the device, as Warp has it."""
        return str(self._device)

    @property
    def steps_taken(self) -> wp.array:
        """(num_envs,) control steps of each environment since its episode started; a copy."""
        return wp.clone(self._simulation.episodes.steps_taken)

    @property
    def is_over(self) -> wp.array:
        """(num_envs,) whether the next step starts another episode; a copy."""
        return wp.clone(self._simulation.episodes.is_over)

    def seed(self, seed) -> None:
        """Seeds every environment anew; its current episode goes on.

        Args:
            seed: Seed of the first environment, after which the others' count up; or one seed
                for each; or None for entropy.

        Raises:
            ValueError: if a seed is not a non-negative integer or None, or if there is not one
                for each environment; nothing has changed.
        """
        seeds = seeding.seeds_of_many(seed, self._num_envs)
        self._seed(dict(enumerate(seeds)))

    def _seed(self, seeds: Mapping[int, int | None]) -> None:
        episodes = self._simulation.episodes
        keys, drawn = episodes.key.numpy().copy(), episodes.drawn.numpy().copy()
        for i, seed in seeds.items():
            keys[i], drawn[i] = states.key(seed), 0
        episodes.key.assign(keys)
        episodes.drawn.assign(drawn)

    def reset(self, ids=None, object_position=None, goal=None, seed=None) -> dm_env.TimeStep:
        """Starts a new episode in every environment, or in some.

        Args:
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.
            object_position: (2,) x and y in m at which objects start, or (n, 2) for n ids.
            goal: (3,) desired goal in m, or (n, 3) for n ids.
            seed: If given, those that are reset are seeded first: with the seed of the first
                environment, after which the others' count up, or with one for each environment,
                where None in place of one goes on with its draws.

        Returns:
            A time step of all environments. Those that were not reset have the observation and
            the step type that they had, and reward 0.

        Raises:
            ValueError: if an id, a place or a seed is not valid; nothing has changed.
        """
        self.check()
        ids = checks.ids(ids, self._num_envs)
        given = {'object_position': object_position, 'goal': goal}
        places = {
            name: self._checked_places(name, value, len(ids))
            for name, value in given.items()
            if value is not None
        }
        if seed is not None:
            seeds = seeding.seeds_of_many(seed, self._num_envs)
            self._seed({i: seeds[i] for i in ids if seeds[i] is not None})
        episodes = self._simulation.episodes
        given_arrays = {'object_position': episodes.given_place, 'goal': episodes.given_goal}
        for name, array in given_arrays.items() if places else ():
            values = array.numpy().copy()
            values[ids] = places.get(name, np.nan)
            array.assign(values)
        chosen = np.zeros(self._num_envs, dtype=bool)
        chosen[ids] = True
        self._simulation.begin(chosen)
        return self._time_step()

    def _checked_places(self, name: str, value: Any, count: int) -> np.ndarray:
        """Returns (count, size) places of a start, each of which can be."""
        size = {'object_position': 2, 'goal': 3}[name] * self._num_goals
        places = checks.places(name, value, count, size)
        for place in places:
            self._starts.check(**{name: place})
        return np.array(places, dtype=np.float64).reshape(count, size)

    def step(self, actions) -> dm_env.TimeStep:
        """Advances every environment by one control step.

        Args:
            actions: (num_envs, 4) float32 on the device, of Warp, PyTorch, JAX or another library
                with DLPack; or what NumPy takes, which is copied. They are clipped to [-1, 1].

        Returns:
            A `dm_env.TimeStep` of Warp's arrays on the device: `step_type`, `reward` and `discount`
            of shape (num_envs,), and a dict of observations of shape (num_envs, ...). They are
            new ones, which no later step writes to.

        Raises:
            ValueError: if `actions` have another shape or type, and no environment has moved; or if
                an earlier step found some that were not finite, in place of which it took zeros.
            PhysicsError: if the physics of environments diverged in an earlier step; the message
                names which. They start anew, and the others go on.
            RuntimeError: if an earlier step had too little room for contacts or constraints; the
                message names the argument to raise.
        """
        self._check_open()
        actions = arrays.float_array('Actions', actions, (self._num_envs, 4), self._device)
        if self._watch.has_seen():
            self._report()
        wp.copy(self._simulation.actions, actions)
        self._simulation.advance()
        self._watch.look()
        time_step = self._time_step()
        if self._device.is_cpu:
            self.check()
        return time_step

    def check(self) -> None:
        """Waits for the device, and raises what has gone wrong on it.

        Raises:
            ValueError, PhysicsError, RuntimeError: as `step` does for what was found in it.
        """
        self._check_open()
        if self._watch.found():
            self._report()

    def _report(self) -> None:
        """Raises what has gone wrong."""
        rows = self._simulation.take_faults()
        self._watch.look()  # Else it would see the old ones again.
        raise faults.error(rows, {'nconmax': self._nconmax, 'njmax': self._njmax})

    def get_states(self, ids=None) -> list[State]:
        """Returns the states of all environments, or of some, as `Environment.get_state` has them.

        An environment of the same task takes one that has a generator of its own kind:
        `dataclasses.replace(state, generator=env.get_state().generator)`.

        Args:
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.

        Raises:
            ValueError: if an id is not valid.
        """
        self.check()
        return self._states.get(checks.ids(ids, self._num_envs))

    def set_states(self, states: Sequence[State], ids=None) -> None:
        """Restores states, each in an environment; the same one may be restored in several.

        States of a `BatchEnvironment` or an `Environment` of the same task will do. After them an
        environment draws on from its own generator, since theirs is of another kind.

        Args:
            states: A state for each id.
            ids: Indices of the environments, or a mask of shape (num_envs,); None for all.

        Raises:
            ValueError: if an id is not valid, or a state is of another task, model or version;
                nothing has changed.
        """
        self.check()
        ids = checks.ids(ids, self._num_envs)
        if len(states) != len(ids):
            raise ValueError(f'{len(ids)} states are needed, got {len(states)}.')
        for state in states:
            self._states.check(state)
        self._states.set(ids, states)

    def _time_step(self) -> dm_env.TimeStep:
        output = self._simulation.output
        time_step = dm_env.TimeStep(
            step_type=wp.clone(output.step_type),
            reward=wp.clone(output.reward),
            discount=wp.clone(output.discount),
            observation={
                'observation': wp.clone(output.observation),
                'achieved_goal': wp.clone(output.achieved_goal),
                'desired_goal': wp.clone(output.desired_goal),
            },
        )
        return self._convert(time_step)

    def single_action_spec(self) -> specs.BoundedArray:
        """Returns the spec of one environment's action, shape (4,)."""
        return self._simulation.environment.action_spec()

    def single_observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of one environment's observations."""
        single = self._simulation.environment.observation_spec()
        return {name: spec.replace(dtype=np.float32) for name, spec in single.items()}

    def reward_spec(self) -> specs.Array:
        """Returns the spec of a time step's reward, shape (num_envs,)."""
        return self._batched(self._simulation.environment.reward_spec().replace(dtype=np.float32))

    def discount_spec(self) -> specs.Array:
        """Returns the spec of a time step's discount, shape (num_envs,)."""
        return self._batched(self._simulation.environment.discount_spec().replace(dtype=np.float32))

    def close(self) -> None:
        """Frees the simulation; closing twice does no harm, and nothing else works afterwards."""
        if not self._is_closed:
            self._simulation.environment.close()
            del self._simulation, self._states, self._watch
            self._is_closed = True
