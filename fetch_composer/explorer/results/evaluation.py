"""How well a policy does, by the figures that every evaluation has.

Needs none of the packages that draw pictures, so that it can be used while a policy is trained.
"""

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

from fetch_composer import policies, tasks
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.episodes import seeds as seeds_lib
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.results import statistics
from fetch_composer.tasks.options import NAMES as OPTION_NAMES

DEFAULT_SEEDS = seeds_lib.TUNING[:100]


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """How well a policy does; each figure with its interval of 95 %.

    Attributes:
        task: Name of the task.
        convention: Name of the convention.
        policy: Name of the policy.
        episodes: How many there were.
        success_rate: Share of episodes that end at their goal, with Wilson's interval.
        mean_return: Mean of the sums of rewards, with Student's interval.
        final_distance: Mean distance to the goal at the last step in m, with Student's interval.
    """

    task: str
    convention: str
    policy: str
    episodes: int
    success_rate: statistics.Estimate
    mean_return: statistics.Estimate
    final_distance: statistics.Estimate


def of_episodes(options: batch_rollout.EpisodeOptions, episodes: Sequence[Episode]) -> Evaluation:
    """Returns the figures of one or more episodes.

    Args:
        options: What they were run with.
        episodes: The episodes.
    """
    return Evaluation(
        task=options.task,
        convention=options.task_options.convention,
        policy=options.policy,
        episodes=len(episodes),
        success_rate=statistics.success_rate([each.is_success for each in episodes]),
        mean_return=statistics.mean([each.total_reward for each in episodes]),
        final_distance=statistics.mean([each.distance[-1] for each in episodes]),
    )


def evaluate(
    policy: Any,
    task: str = 'push',
    *,
    seeds: Sequence[int] = DEFAULT_SEEDS,
    num_envs: int = 64,
    num_threads: int | None = None,
    vectorized: bool = False,
    trust_pickle: bool = False,
    on_progress: Callable[[int], None] | None = None,
    **task_kwargs: Any,
) -> Evaluation:
    """Runs an episode for each seed on the native batch, and returns how well the policy does.

    Args:
        policy: A name, a file or code, as `policies.load` takes it; or the policy itself: a
            function that takes an observation and returns an action, a class (made anew for each
            episode), an object with a method `act_on_batch`, or a model of Stable-Baselines3,
            which acts deterministically. One with a method `reset` may remember its episode, and
            so it plays one after the other.
        task: Name of the task.
        seeds: A seed for each episode. The default is 100 of those to tune with;
            `STANDARD_SEEDS` are for figures to be published, and for nothing else.
        num_envs: How many episodes run at a time; it changes none of them.
        num_threads: Threads that share them; by default one for each processor.
        vectorized: Whether the policy is a function that takes observations of many environments,
            (n, ...), and returns their actions, (n, 4) by default.
        trust_pickle: Whether code within a policy's file may run.
        on_progress: Called after every step of the batch, with the number of episodes that took
            it; what it raises ends the evaluation.
        **task_kwargs: Options of the task (see `tasks.TaskOptions`): `convention`, ...

    Raises:
        ValueError: if an option is not valid; the message says what would be.
        PolicyError: if the policy fails.
        PhysicsError: if the physics of an episode diverges.
    """
    seeds = list(seeds)
    if not seeds:
        raise ValueError('seeds must name at least one episode.')
    unknown = sorted(set(task_kwargs) - set(OPTION_NAMES))
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(repr, unknown))}; of a task, valid are '
            f'{", ".join(OPTION_NAMES)}.'
        )
    if vectorized and not callable(policy):
        raise ValueError('vectorized is for a function; what is named or loaded knows by itself.')
    name, load_policy = policy, None
    if not isinstance(policy, str):
        name = policies.given.name(policy)
        load_policy = functools.partial(policies.given.factory, policy, vectorized=vectorized)
        if policies.given.keeps_state(policy):
            num_envs = 1
    task_options = dataclasses.replace(tasks.default_options(task), **task_kwargs)
    options = batch_rollout.EpisodeOptions(task, name, task_options, trust_pickle)
    with batch_rollout.BatchRollout(
        options, min(num_envs, len(seeds)), num_threads, load_policy=load_policy
    ) as batch:
        episodes = [each for some in batch.run(seeds, on_progress) for each in some]
    return of_episodes(options, episodes)
