"""Sides measured in turn, so that what else the machine does meets them all alike."""

import contextlib
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


def measure_in_turn(
    sides: Sequence[meters.Meter],
    interpreters: meters.Interpreters,
    num_rounds: int,
    num_warm_up: int,
) -> list[tuple[float, ...]]:
    """Returns what each side took in each round.

    Only one side runs at a time. Every other round runs through them backwards, so that a
    machine that gets slower or faster favours none.

    Args:
        sides: What takes turns.
        interpreters: Where they run.
        num_rounds: How many rounds are kept.
        num_warm_up: How many before them are not.
    """
    rounds = []
    with contextlib.ExitStack() as stack:
        measures = [stack.enter_context(side.opened(interpreters)) for side in sides]
        for i in range(num_warm_up + num_rounds):
            costs = [measure() for measure in (reversed(measures) if i % 2 else measures)]
            rounds.append(tuple(reversed(costs) if i % 2 else costs))
    return rounds[num_warm_up:]
