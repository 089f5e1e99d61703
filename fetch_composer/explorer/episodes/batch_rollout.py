"""Episodes run on the batch, each the same whatever runs beside it.

What is needed to run one travels well: `EpisodeOptions` and seeds in, `Episode`s out, all of which
can be pickled. Needs none of the packages that draw pictures.
"""

import contextlib
import dataclasses
import pathlib
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer import policies, user_modules
from fetch_composer.batch import BatchEnvironment
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.episodes.origin import Origin
from fetch_composer.explorer.episodes.recording import Recording
from fetch_composer.tasks import TaskOptions, checks

PolicyLoader = Callable[[policies.PolicyContext], policies.PolicyFactory]

_Observations = Mapping[str, np.ndarray]
# Takes observations, and which rows run; returns the actions of all rows.
_Act = Callable[[_Observations, np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class EpisodeOptions:
    """What decides on an episode, beside its seed.

    Attributes:
        task: Name of the task.
        policy: Name of the policy, its file, or its code, noise included; see `policies.load`.
        task_options: Options of the task.
        trust_pickle: Whether code within a policy's file may run.
        imports: Modules to import first, which register tasks of one's own.
        origin: What the episodes are the continuation of; None for whole ones.

    Raises:
        ValueError: if episodes would never end.
    """

    task: str
    policy: str
    task_options: TaskOptions = TaskOptions()
    trust_pickle: bool = False
    imports: tuple[str, ...] = ()
    origin: Origin | None = None

    def __post_init__(self) -> None:
        if self.task_options.max_episode_steps is None:
            raise ValueError('max_episode_steps must be a positive integer: episodes must end.')

    @property
    def steps(self) -> int:
        """Control steps of an episode that does not end before."""
        assert self.task_options.max_episode_steps is not None
        return self.task_options.max_episode_steps

    @property
    def task_kwargs(self) -> dict[str, Any]:
        """The options of the task, as `fetch_composer.load` takes them."""
        options = self.task_options
        return {each.name: getattr(options, each.name) for each in dataclasses.fields(options)}


class PolicyError(RuntimeError):
    """A policy failed, or gave an action that does not fit."""


def run_episodes(
    options: EpisodeOptions,
    seeds: Sequence[int],
    num_envs: int = 64,
    num_threads: int | None = None,
) -> list[Episode]:
    """Returns the episodes of some seeds, in their order.

    Args:
        options: What to run.
        seeds: A non-negative integer for each episode.
        num_envs: How many episodes run at a time; it changes none of them.
        num_threads: Threads that share them; by default one for each processor.

    Raises:
        ValueError: if an option is not valid; the message says what would be.
        PolicyError: if the policy fails.
        PhysicsError: if the physics of an episode diverges.
    """
    seeds = checks.sequence('seeds', seeds)
    if not seeds:
        return []
    with BatchRollout(options, min(num_envs, len(seeds)), num_threads) as batch:
        return [episode for chunk in batch.run(seeds) for episode in chunk]


class BatchRollout:
    """Runs episodes, `num_envs` at a time, and can be used again for others."""

    def __init__(
        self,
        options: EpisodeOptions,
        num_envs: int,
        num_threads: int | None = None,
        make_policy: policies.PolicyFactory | None = None,
        load_policy: PolicyLoader | None = None,
    ) -> None:
        """Loads the task, and the policy unless it is given.

        Args:
            options: What to run.
            num_envs: How many episodes run at a time.
            num_threads: Threads that share them; by default one for each processor.
            make_policy: What `tried_policy` has returned for these options.
            load_policy: Loads the policy; by default the one that is named in the options.

        Raises:
            ValueError: if an option is not valid; the message says what would be.
            PolicyError: if the policy fails at once.
        """
        user_modules.load_all(options.imports)
        self._options = options
        self._num_envs = num_envs
        self._batch = BatchEnvironment(
            options.task, num_envs, num_threads, seed=0, **options.task_kwargs
        )
        self._make_policy = make_policy or self._tried_policy(load_policy)

    def _tried_policy(self, load_policy: PolicyLoader | None) -> policies.PolicyFactory:
        context = policies.PolicyContext(
            self._batch.task_name,
            self._batch.options.convention,
            self._batch.single_action_spec(),
            self._batch.single_observation_spec(),
            self._batch.options.action_mode,
        )
        observation = next(_rows(self._batch.reset().observation))
        return tried_policy(self._options, context, observation, load_policy)

    def run(
        self, seeds: Sequence[int], on_progress: Callable[[int], None] | None = None
    ) -> Iterator[list[Episode]]:
        """Yields the episodes, in the order of their seeds, `num_envs` or fewer at a time.

        Each is what the policy does in `fetch_composer.load(task, seed=seed)`, to the bit and for
        any `num_envs`, if its actions are.

        Args:
            seeds: A non-negative integer for each episode.
            on_progress: Called after every step of the batch, with the number of episodes that
                took it or ended before; what it raises ends the run.

        Raises:
            PolicyError: if the policy fails.
            PhysicsError: if the physics of an episode diverges.
        """
        on_progress = on_progress or (lambda episodes: None)
        for start in range(0, len(seeds), self._num_envs):
            yield self._run(list(seeds[start : start + self._num_envs]), on_progress)

    def _run(self, seeds: list[int], on_progress: Callable[[int], None]) -> list[Episode]:
        count = len(seeds)
        idle = self._batch.num_envs - count
        self._batch.seed([*seeds, *seeds[-1:] * idle])
        with _failures_named(f'policy {self._options.policy}, at the start of an episode'):
            acting = [self._make_policy(seed) for seed in seeds]
            for policy in acting:
                policy.reset()
        act = _acting_on_rows(acting)
        record = Recording(seeds, self._batch.reset().observation)
        if self._options.origin is not None:
            self._go_back_to(self._options.origin, record, act)
        while record.running.any():
            with _failures_named(f'policy {self._options.policy}, step {record.steps}'):
                action = act(record.observation, record.running)
                policies.check_shape(action, (count, *self._batch.single_action_spec().shape))
                _check_finite(action, seeds)
                action = self._batch.options.mode.clip(action, (count,)).astype(np.float32)
            action = np.concatenate([action, np.repeat(action[-1:], idle, axis=0)])
            started = time.perf_counter()
            time_step = self._batch.step(action)
            record.add(action, time_step, (time.perf_counter() - started) / count)
            on_progress(count)
        for _ in range(record.steps, self._options.steps):
            on_progress(count)
        return record.episodes()

    def _go_back_to(self, origin: Origin, record: Recording, act: _Act) -> None:
        """Puts the batch where recorded episodes were; policies are shown what was before."""
        seeds = record.seeds
        states = origin.states(seeds, self._batch.get_states(np.arange(len(seeds))))
        for past in origin.past(seeds):
            with _failures_named(f'policy {self._options.policy}, step {record.steps}'):
                act(record.observation, record.running)
            record.add_past(*past)
        idle = self._batch.num_envs - len(seeds)
        self._batch.set_states([*states, *states[-1:] * idle])

    def close(self) -> None:
        """Frees the simulations."""
        self._batch.close()

    def __enter__(self) -> 'BatchRollout':
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()


def tried_policy(
    options: EpisodeOptions,
    context: policies.PolicyContext,
    observation: Mapping[str, np.ndarray],
    load_policy: PolicyLoader | None = None,
) -> policies.PolicyFactory:
    """Loads a policy and lets one of its own act once, so that mistakes show before the first step.

    Args:
        options: What names the policy.
        context: What is known of the environment.
        observation: An observation of the environment.
        load_policy: Loads the policy; by default the one that is named in the options.

    Returns:
        What makes the policy for each seed.

    Raises:
        ValueError: if there is no such policy; the message says what is valid.
        PolicyError: if it fails, or its action does not fit.
    """
    if load_policy is None:
        make = policies.factory(options.policy, context, options.trust_pickle)
        of_mixture = policies.parts(options.policy)
    else:
        make, of_mixture = load_policy(context), (options.policy,)
    for name in of_mixture:
        is_all = len(of_mixture) == 1
        tried = make if is_all else policies.factory(name, context, options.trust_pickle)
        with _failures_named(f'policy {name}, before the first step'):
            policies.check_action(tried(0), observation, context)
    return make


@contextlib.contextmanager
def _failures_named(where: str) -> Iterator[None]:
    """Makes a `PolicyError` of any exception, which says where in the policy it comes from."""
    try:
        yield
    except policies.ActionError as error:
        raise PolicyError(f'{where}: {error}') from error
    except (Exception, SystemExit) as error:  # Code of the user's that ends Python, too.
        place = traceback.extract_tb(error.__traceback__)[-1]
        raise PolicyError(
            f'{where}: {type(error).__name__}: {error} '
            f'({pathlib.Path(place.filename).name}, line {place.lineno})'
        ) from error


def _check_finite(action: np.ndarray, seeds: Sequence[int]) -> None:
    finite = np.isfinite(action).reshape(len(action), -1).all(axis=1)
    if not finite.all():
        which = [seed for seed, each in zip(seeds, finite, strict=False) if not each]
        raise policies.ActionError(f'The action is not finite for seed {which[0]}.')


def _acting_on_rows(acting: Sequence[policies.Policy]) -> _Act:
    """Returns what gives each environment's action, (n, ...): in one call, if one policy is all.

    Rows that do not run get actions of 0, and no policy is asked for them alone.
    """
    first = acting[0]
    act_on_batch = getattr(first, 'act_on_batch', None)
    if act_on_batch is not None and all(each is first for each in acting):

        def act_at_once(observations: _Observations, running: np.ndarray) -> np.ndarray:
            # Always for all rows, whose number may decide on rounding.
            action = np.asarray(act_on_batch(observations))
            return action if running.all() else np.where(running[:, np.newaxis], action, 0)

        return act_at_once

    def act(observations: _Observations, running: np.ndarray) -> np.ndarray:
        # Copied one by one, since a policy may return the same array every time.
        actions = [
            np.array(policy(row))
            for policy, row, runs in zip(acting, _rows(observations), running, strict=True)
            if runs
        ]
        for action in actions:
            policies.check_shape(action, actions[0].shape)
        stacked = np.stack(actions)
        result = np.zeros((len(acting), *stacked.shape[1:]), stacked.dtype)
        result[running] = stacked
        return result

    return act


def _rows(observations: _Observations) -> Iterator[dict[str, np.ndarray]]:
    """Yields each environment's own observation."""
    names = tuple(observations)
    for values in zip(*observations.values(), strict=True):
        yield dict(zip(names, values, strict=True))
