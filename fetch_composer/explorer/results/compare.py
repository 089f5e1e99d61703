"""Two policies on the same seeds."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.results import statistics
from fetch_composer.explorer.results.candidate import Candidate


@dataclasses.dataclass(frozen=True)
class Comparison:
    """What changes from one policy to another, over the seeds that both have run.

    Attributes:
        first: Name of the one.
        second: Name of the other.
        seeds: How many seeds both have run.
        both: On how many of them both succeed.
        only_first: On how many only the one does.
        only_second: On how many only the other does.
        neither: On how many neither does.
        success: Success rate of the second less that of the first.
        final_distance: Mean of its final distance less that of the first, in m; None if they
            share fewer than two seeds.
    """

    first: str
    second: str
    seeds: int
    both: int
    only_first: int
    only_second: int
    neither: int
    success: statistics.Estimate
    final_distance: statistics.Estimate | None

    def figures(self) -> dict[str, Any]:
        """Returns the same as JSON has it."""
        figures = dataclasses.asdict(self)
        figures['success_difference'] = figures.pop('success')
        figures['final_distance_difference_m'] = figures.pop('final_distance')
        return figures


def compare_all(candidates: Sequence[Candidate]) -> list[Comparison]:
    """Returns the comparison of the first policy with each other that shares a seed with it."""
    first, *others = candidates
    compared = [
        compare(first.policy, first.episodes, each.policy, each.episodes) for each in others
    ]
    return [each for each in compared if each is not None]


def compare(
    first: str,
    first_episodes: Sequence[Episode],
    second: str,
    second_episodes: Sequence[Episode],
) -> Comparison | None:
    """Returns the comparison of two policies' episodes; None if they share no seed."""
    pairs = paired(first_episodes, second_episodes)
    if not pairs:
        return None
    one, two = (np.array([each.is_success for each in side]) for side in zip(*pairs, strict=True))
    distances = [[each.distance[-1] for each in side] for side in zip(*pairs, strict=True)]
    return Comparison(
        first=first,
        second=second,
        seeds=len(pairs),
        both=int(np.sum(one & two)),
        only_first=int(np.sum(one & ~two)),
        only_second=int(np.sum(~one & two)),
        neither=int(np.sum(~one & ~two)),
        success=statistics.success_difference(one, two),
        final_distance=statistics.mean_difference(*distances),
    )


def paired(first: Sequence[Episode], second: Sequence[Episode]) -> list[tuple[Episode, Episode]]:
    """Returns pairs of episodes of the same seed, in the order of the first."""
    of_seed = {each.seed: each for each in second}
    return [(each, of_seed[each.seed]) for each in first if each.seed in of_seed]
