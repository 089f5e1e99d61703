"""Intervals, and the comparison of two policies."""

import numpy as np
import pytest

from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.results import compare, statistics


@pytest.mark.parametrize(
    ('successes', 'count', 'low', 'high'),
    # Newcombe (1998), Statistics in Medicine 17, 857-872, table I, method 3.
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_the_interval_of_a_success_rate_is_wilsons(successes, count, low, high):
    estimate = statistics.success_rate([True] * successes + [False] * (count - successes))
    assert estimate.value == successes / count
    assert estimate.low == pytest.approx(low, abs=5e-5)
    assert estimate.high == pytest.approx(high, abs=5e-5)
    opposite = statistics.success_rate([False] * successes + [True] * (count - successes))
    assert opposite.low == pytest.approx(1 - estimate.high)


def test_an_interval_reaches_the_ends_at_none_and_at_all():
    assert statistics.success_rate([True] * 7).high == 1.0
    assert statistics.success_rate([False] * 7).low == 0.0


def test_the_interval_of_a_paired_difference_covers_it_as_often_as_it_says():
    generator = np.random.default_rng(0)
    probabilities = (0.5, 0.1, 0.25, 0.15)  # Both, only the first, only the second, neither.
    covered = 0
    for drawn in generator.choice(4, size=(1000, 60), p=probabilities):
        first, second = np.isin(drawn, (0, 1)), np.isin(drawn, (0, 2))
        estimate = statistics.success_difference(first, second)
        assert -1 <= estimate.low <= estimate.value <= estimate.high <= 1
        covered += estimate.low <= 0.15 <= estimate.high
    assert 0.93 <= covered / 1000 <= 0.985


def test_pairs_tell_more_than_two_rates_alone():
    first, second = (
        np.repeat([True, False], 50),
        np.repeat([True, True, False, False], (48, 6, 2, 44)),
    )
    paired = statistics.success_difference(first, second)
    shuffled = statistics.success_difference(first, np.roll(second, 50))
    assert paired.high - paired.low < 0.6 * (shuffled.high - shuffled.low)


def test_a_policy_compared_with_itself_differs_by_nothing():
    for successes in ([True] * 5, [False] * 5, [True, False, True]):
        estimate = statistics.success_difference(successes, successes)
        assert estimate.value == 0 and estimate.low <= 0 <= estimate.high
    assert statistics.mean_difference([1.0, 2.0], [1.0, 2.0]).value == 0


def test_the_interval_of_a_mean_difference_is_students():
    estimate = statistics.mean_difference([0.0, 0.0, 0.0, 0.0], [1.0, 2.0, 3.0, 4.0])
    assert estimate.value == 2.5
    assert estimate.high - estimate.value == pytest.approx(3.182446 * 1.290994 / 2, abs=1e-5)
    assert statistics.mean_difference([1.0], [2.0]) is None


def _episode(seed, distance):
    goals = np.zeros((3, 3))
    return Episode(
        seed=seed, observation=np.zeros((3, 25)), achieved_goal=goals + (distance, 0, 0),
        desired_goal=goals, action=np.zeros((2, 4)), reward=np.zeros(2), step_seconds=0.1,
    )  # fmt: skip


def test_policies_are_compared_on_the_seeds_that_both_have_run():
    first = [_episode(seed, 0.01) for seed in (1, 2, 3)]
    second = [_episode(seed, distance) for seed, distance in ((4, 0.3), (3, 0.04), (2, 0.11))]
    comparison = compare.compare('a', first, 'b', second)
    assert comparison.seeds == 2
    assert (comparison.both, comparison.only_first) == (1, 1)
    assert (comparison.only_second, comparison.neither) == (0, 0)
    assert comparison.success.value == -0.5
    assert comparison.final_distance.value == pytest.approx(0.065)
    assert compare.compare('a', first[:1], 'b', second) is None
