"""A task being learned, iteration by iteration, and all that has to be kept to go on later."""

import json
from collections.abc import Callable, Mapping
from concurrent import futures

import jax
import jax.numpy as jnp
import numpy as np

from fetch_composer import batch as batch_lib
from fetch_composer.learning import exploration, networks, replay, rollout, td3
from fetch_composer.learning.relay import Relay
from fetch_composer.learning.replay import Episodes
from fetch_composer.learning.settings import TRAINING_SEEDS, TUNING_SEEDS, Settings

_MOST_UPDATES_AT_ONCE = 200  # Their transitions are in memory at the same time.
_RECENT = 20  # Iterations over which success while exploring is averaged.


class DivergedError(ArithmeticError):
    """The networks hold numbers that are none."""


class Trainer:
    """An iteration is one exploring episode in every environment, then updates.

    Attributes:
        settings: Its settings.
        iterations: How many there were.
        updates: Updates of the critics so far.
        loss: Mean loss of the critics in the last iteration.
        observation_size: How many numbers the networks observe, the goal's apart.
        start: (size,) an observation as an episode begins; zeros before the first.
    """

    def __init__(
        self,
        task: str,
        convention: str,
        seed: int,
        settings: Settings,
        relay: Relay | None = None,
        make_batch: Callable[..., batch_lib.BatchEnvironment] = batch_lib.BatchEnvironment,
    ) -> None:
        """Initializes a learner that has learned nothing; the seed decides on all that follows.

        Args:
            task: Name of the task.
            convention: Name of the convention.
            seed: Decides on all that follows.
            settings: Its settings.
            relay: A policy of Reach, if it is to begin exploring episodes.
            make_batch: Returns what steps the environments, of NumPy's arrays.
        """
        self.settings = settings
        self._batch = make_batch(
            task,
            settings.num_envs,
            convention=convention,
            max_episode_steps=settings.episode_steps,
        )
        (size,) = self._batch.single_observation_spec()['observation'].shape
        self.observation_size = size
        # Two, since exploring and updates go on at the same time, and one for the weights.
        self._generator, self._exploring_generator, generator = map(
            np.random.default_rng, np.random.SeedSequence(seed).spawn(3)
        )
        self._replay = replay.HindsightReplay(settings, settings.episode_steps, size)
        self._statistics = networks.FeatureStatistics(networks.num_features(size))
        self._explorer = exploration.Explorer(settings, self._exploring_generator, relay)
        self._explorations = futures.ThreadPoolExecutor(max_workers=1)
        self._learner = td3.init(generator, settings.hidden, networks.num_features(size))
        self._constants = td3.Constants.of(settings)
        self._successes: list[float] = []
        self.iterations = 0
        self.updates = 0
        self.loss = 0.0
        self.start = np.zeros(size, np.float32)

    @property
    def environment_steps(self) -> int:
        """Control steps so far, all environments together."""
        return self.iterations * self._steps_per_iteration

    @property
    def _steps_per_iteration(self) -> int:
        return self.settings.num_envs * self.settings.episode_steps

    @property
    def is_done(self) -> bool:
        """Whether as many control steps were made as the settings ask for."""
        return self.environment_steps >= self.settings.environment_steps

    @property
    def policy(self) -> networks.Policy:
        """What has been learned so far."""
        return networks.Policy(self._learner.target_actor, self._statistics.scale())

    @property
    def _generators(self) -> tuple[np.random.Generator, np.random.Generator]:
        return self._generator, self._exploring_generator

    @property
    def exploring_success(self) -> float:
        """Share of the last iterations' episodes that ended at their goal."""
        return float(np.mean(self._successes[-_RECENT:]))

    def iterate(self) -> None:
        """Explores for one episode in every environment, and makes updates meanwhile.

        The updates learn from the episodes before these: so neither waits for the other, and a
        second processor is of use.

        Raises:
            DivergedError: if the loss is not a number.
        """
        exploring = self._explorations.submit(self._explore, self._acting_policy())
        try:
            if self.iterations >= self.settings.random_iterations:
                self._update()
        finally:
            episodes = exploring.result()
        self.start = episodes.observations[0, 0]
        self._replay.add(episodes)
        self._statistics.add(episodes.observations, episodes.goals)
        self._successes.append(float(episodes.is_success().mean()))
        self.iterations += 1

    def _acting_policy(self) -> networks.Policy | None:
        """Returns a copy of the policy, which updates leave alone; None for random actions."""
        if self.iterations < self.settings.random_iterations:
            return None
        return jax.tree.map(np.array, self.policy)

    def _explore(self, policy: networks.Policy | None) -> Episodes:
        settings, draw = self.settings, self._exploring_generator
        seeds = draw.integers(len(TRAINING_SEEDS), size=settings.num_envs)
        return rollout.run_episodes(
            self._batch,
            seeds.tolist(),
            settings.episode_steps,
            lambda observation, goal: self._explorer.act(policy, observation, goal),
            lambda observation: self._explorer.begin(
                observation, self._falling(settings.noise_falls_until)
            ),
        )

    def _update(self) -> None:
        settings = self.settings
        cycles = settings.updates_per_step * self._steps_per_iteration / settings.actor_delay
        num_scans = int(np.ceil(cycles * settings.actor_delay / _MOST_UPDATES_AT_ONCE))
        shape = (max(round(cycles / num_scans), 1), settings.actor_delay, settings.batch_size)
        scale, rate = self._statistics.scale(), self._learning_rate()
        is_late = self._falling() > 0
        losses: list[jax.Array] = []
        for i in range(num_scans):
            # Drawn while the updates before are under way; no more than these are in memory.
            transitions = self._replay.sample(self._generator, shape, is_late)
            if i > 0:
                losses[-1].block_until_ready()
            self._learner, loss = td3.update(
                self._learner, transitions, scale, rate, self._constants
            )
            losses.append(loss)
            self.updates += shape[0] * shape[1]
        self.loss = float(np.mean([float(each) for each in losses]))
        if not all(np.isfinite(each).all() for each in jax.tree.leaves(self._learner.actor)):
            self.loss = np.nan
        if not np.isfinite(self.loss):
            raise DivergedError(
                f'The networks diverged within iteration {self.iterations}: the loss is no '
                'number. Lower the learning_rate, or try another seed.'
            )

    def _falling(self, part: float = 1.0) -> float:
        """Returns how far the second half of a part of the run is through, from 0 to 1."""
        done = self.environment_steps / self.settings.environment_steps / part
        return min(max(2 * done - 1, 0), 1)

    def _learning_rate(self) -> float:
        """Returns the step size: constant, then falling in a straight line to the end."""
        first, last = self.settings.learning_rate, self.settings.final_learning_rate
        return first + self._falling() * (last - first)

    def evaluate(self, seeds: range | None = None) -> np.ndarray:
        """Returns whether episodes end at their goal, of the tuning seeds unless others are given.

        The policy acts without noise.
        """
        if seeds is None:
            seeds = TUNING_SEEDS[: self.settings.evaluation_episodes]
        return rollout.evaluate(self._batch, self.policy.act, seeds, self.settings.episode_steps)

    def close(self) -> None:
        """Frees the simulations."""
        self._explorations.shutdown()
        self._batch.close()

    def state(self) -> dict[str, np.ndarray]:
        """Returns all that decides on what follows, as arrays."""
        return {
            **flatten('learner', self._learner),
            **{f'replay/{name}': each for name, each in self._replay.state().items()},
            'statistics/sums': self._statistics.sums,
            'statistics/count': np.array(self._statistics.count),
            'generators': np.array(
                [json.dumps(each.bit_generator.state) for each in self._generators]
            ),
            'successes': np.array(self._successes),
            'iterations': np.array(self.iterations),
            'updates': np.array(self.updates),
            'loss': np.array(self.loss),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Takes over what `state` returned."""
        self._learner = unflatten('learner', self._learner, state)
        names = self._replay.state()
        self._replay.restore({name: state[f'replay/{name}'] for name in names})
        self._statistics.sums = state['statistics/sums']
        self._statistics.count = int(state['statistics/count'])
        for generator, kept in zip(self._generators, state['generators'], strict=True):
            generator.bit_generator.state = json.loads(str(kept))
        self._successes = state['successes'].tolist()
        self.iterations = int(state['iterations'])
        self.updates = int(state['updates'])
        self.loss = float(state['loss'])


def flatten(name: str, tree) -> dict[str, np.ndarray]:
    """Returns the arrays of a tree, each under the tree's name and a number."""
    return {f'{name}/{i}': np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(tree))}


def unflatten(name: str, like, arrays: Mapping[str, np.ndarray]):
    """Returns a tree of the structure of `like`, with the arrays that `flatten` returned."""
    leaves, structure = jax.tree.flatten(like)
    kept = [jnp.asarray(arrays[f'{name}/{i}']) for i in range(len(leaves))]
    return jax.tree.unflatten(structure, kept)
