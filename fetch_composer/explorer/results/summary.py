"""The figures of a run, as summary.json has them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fetch_composer import policies
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.results import compare, statistics
from fetch_composer.explorer.results.candidate import Candidate


def of_run(
    candidates: Sequence[Candidate], comparisons: Sequence[compare.Comparison]
) -> dict[str, Any]:
    """Returns the figures of all policies of a run, fit for JSON.

    Args:
        candidates: The policies, with one finished episode or more each.
        comparisons: Of the first policy with each other.
    """
    if len(candidates) == 1 and candidates[0].is_alone:
        return summarize(candidates[0].episodes, candidates[0].policy)
    return {
        'comparisons': [each.figures() for each in comparisons],
        'policies': [
            {'policy': each.policy, **summarize(each.episodes, each.policy)} for each in candidates
        ],
    }


def summarize(episodes: Sequence[Episode], policy: str = '') -> dict[str, Any]:
    """Returns figures of one or more episodes, fit for JSON.

    Args:
        episodes: The episodes.
        policy: Name of the policy. If it is a mixture, each episode has the name of its own.
    """
    is_mixture = policies.is_mixture(policy)
    distances = [float(each.distance[-1]) for each in episodes]
    returns = [each.total_reward for each in episodes]
    seconds = sum(each.step_seconds for each in episodes)
    success = statistics.success_rate([each.is_success for each in episodes])
    return {
        'success_rate': success.value,
        'success_interval': [success.low, success.high],
        'return': _spread(returns),
        'final_distance_m': _spread(distances),
        'control_steps_per_second': round(sum(each.steps for each in episodes) / seconds, 1),
        'episodes': [
            {
                'seed': each.seed,
                **({'policy': policies.player(policy, each.seed)} if is_mixture else {}),
                'steps': each.steps,
                'is_success': each.is_success,
                'return': each.total_reward,
                'final_distance_m': distance,
            }
            for each, distance in zip(episodes, distances, strict=True)
        ],
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {
        'mean': float(np.mean(values)),
        'median': float(np.median(values)),
        'min': float(np.min(values)),
        'max': float(np.max(values)),
    }
