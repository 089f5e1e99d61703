"""How sure the figures of a run are: intervals of 95 %."""

import dataclasses
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

CONFIDENCE = 0.95
_Z = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)


@dataclasses.dataclass(frozen=True)
class Estimate:
    """An estimate with its interval.

    Attributes:
        value: The estimate.
        low: Lower end of the interval.
        high: Upper end of the interval.
    """

    value: float
    low: float
    high: float


def success_rate(is_success: ArrayLike) -> Estimate:
    """Returns the share of successes with its Wilson score interval, right for few episodes too."""
    successes = np.asarray(is_success, dtype=bool)
    low, high = _wilson(int(successes.sum()), successes.size)
    return Estimate(float(successes.mean()), low, high)


def _wilson(successes: int, count: int) -> tuple[float, float]:
    rate = successes / count
    centre = rate + _Z**2 / (2 * count)
    half_width = _Z * np.sqrt(rate * (1 - rate) / count + (_Z / (2 * count)) ** 2)
    scale = 1 + _Z**2 / count
    # If all fail, or all succeed, rounding would leave an end just inside.
    low = 0.0 if successes == 0 else (centre - half_width) / scale
    high = 1.0 if successes == count else (centre + half_width) / scale
    return float(low), float(high)


def success_difference(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Returns how much more often the second succeeds than the first, on the same seeds.

    The interval is Newcombe's for paired proportions (1998, method 10): it joins the two Wilson
    intervals by how the successes go together.

    Args:
        first: Whether each episode of one policy succeeded.
        second: The same for the other, seed by seed.
    """
    one, two = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    count = len(one)
    both, neither = int(np.sum(one & two)), int(np.sum(~one & ~two))
    only_one, only_two = int(np.sum(one & ~two)), int(np.sum(~one & two))

    spread = float(one.sum()) * (count - one.sum()) * two.sum() * (count - two.sum())
    together = float(both * neither - only_one * only_two)
    if together > 0:
        together = max(together - count / 2, 0.0)
    correlation = together / np.sqrt(spread) if spread else 0.0

    (low_one, high_one), (low_two, high_two) = (_wilson(int(x.sum()), count) for x in (one, two))
    rate_one, rate_two = one.mean(), two.mean()
    difference = float(rate_two - rate_one)

    def reach(down: float, up: float) -> float:
        return float(np.sqrt(max(down**2 - 2 * correlation * down * up + up**2, 0.0)))

    return Estimate(
        difference,
        difference - reach(rate_two - low_two, high_one - rate_one),
        difference + reach(high_two - rate_two, rate_one - low_one),
    )


def mean(values: ArrayLike) -> Estimate:
    """Returns the mean with Student's interval, which has no ends for a single value."""
    from scipy import stats  # Takes longer than all that is imported here.

    found = np.asarray(values, dtype=float)
    count, value = found.size, float(found.mean())
    if count < 2:
        return Estimate(value, -np.inf, np.inf)
    half_width = float(
        stats.t.ppf((1 + CONFIDENCE) / 2, count - 1) * found.std(ddof=1) / np.sqrt(count)
    )
    return Estimate(value, value - half_width, value + half_width)


def mean_difference(first: ArrayLike, second: ArrayLike) -> Estimate | None:
    """Returns how much larger the second is than the first on average, pair by pair.

    None for fewer than two pairs.
    """
    differences = np.subtract(second, first)
    return mean(differences) if len(differences) > 1 else None
