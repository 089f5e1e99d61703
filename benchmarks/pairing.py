"""Two sides measured in turn, so that what else the machine does meets both alike."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from benchmarks import meters


@dataclasses.dataclass(frozen=True)
class Quartiles:
    """Median and spread of some numbers."""

    lower: float
    median: float
    upper: float

    @classmethod
    def of(cls, numbers: Sequence[float]) -> 'Quartiles':
        """Returns the quartiles of at least one number."""
        return cls(*(float(q) for q in np.quantile(numbers, (0.25, 0.5, 0.75))))


def measure_pairs(
    ours: meters.Meter,
    peer: meters.Meter,
    interpreters: meters.Interpreters,
    num_pairs: int,
    num_warm_up: int,
) -> list[tuple[float, float]]:
    """Returns what each side took in each pair of rounds.

    Only one side runs at a time. Which of them goes first alternates, so that a machine that
    gets slower or faster favours neither.

    Args:
        ours: One side.
        peer: The other.
        interpreters: Where they run.
        num_pairs: How many pairs are kept.
        num_warm_up: How many before them are not.
    """
    pairs = []
    with ours.opened(interpreters) as measure_ours, peer.opened(interpreters) as measure_peer:
        for i in range(num_warm_up + num_pairs):
            if i % 2:
                cost_peer, cost_ours = measure_peer(), measure_ours()
            else:
                cost_ours, cost_peer = measure_ours(), measure_peer()
            pairs.append((cost_ours, cost_peer))
    return pairs[num_warm_up:]
