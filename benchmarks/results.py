"""Measures rows and takes control steps apart; the results are plain enough for JSON."""

import platform
from collections.abc import Iterable
from importlib import metadata
from typing import Any

from benchmarks import meters, pairing
from benchmarks.rows import Breakdown, Row
from fetch_composer.batch.simulations import num_processors

_MIN_PAIRS = 3
_PACKAGES = ('dm-control', 'mujoco', 'numpy')


def measure_row(
    row: Row, interpreters: meters.Interpreters, num_pairs: int, num_warm_up: int
) -> dict[str, Any]:
    """Returns what a row came to; one whose peer is not there, or fails, is said to be skipped."""
    result = {
        'group': row.group,
        'ours': row.ours.label,
        'peer': row.peer.label,
        'quantity': row.quantity,
        'num_envs': row.num_envs,
        'unit': row.unit,
        'goal': row.goal,
    }
    needed = (row.ours.interpreter, row.peer.interpreter)
    for each in needed:
        if interpreters.missing(each):
            return {**result, 'skipped': f'{each} is not installed'}
    count = max(_MIN_PAIRS, round(row.pairs * num_pairs))
    discarded = num_warm_up if row.warms_up else 0
    try:
        pairs = pairing.measure_in_turn((row.ours, row.peer), interpreters, count, discarded)
    except meters.WorkerError as error:
        if set(needed) == {meters.OWN}:
            raise
        return {**result, 'skipped': str(error)}
    ratio = pairing.Quartiles.of([row.ratio(ours, peer) for ours, peer in pairs])
    costs = [pairing.Quartiles.of(side).median for side in zip(*pairs, strict=True)]
    return {
        **result,
        'pairs': count,
        'ratio': ratio.median,
        'ratio_quartiles': [ratio.lower, ratio.upper],
        'our_cost': costs[0],
        'peer_cost': costs[1],
        'reached': row.reached(ratio.median),
    }


def measure_breakdown(
    breakdown: Breakdown, interpreters: meters.Interpreters, num_rounds: int, num_warm_up: int
) -> dict[str, Any]:
    """Returns the median microseconds of each part of a control step, and of the whole."""
    with breakdown.worker.opened(interpreters) as measure:
        rounds = [measure() for _ in range(num_warm_up + num_rounds)][num_warm_up:]
    parts = {
        name: pairing.Quartiles.of([each[name] for each in rounds]).median for name in rounds[0]
    }
    return {'label': breakdown.label, 'whole': parts.pop('whole'), 'parts': parts}


def measure_growth(
    sides: Iterable[tuple[int, meters.Meter]],
    interpreters: meters.Interpreters,
    num_rounds: int,
    num_warm_up: int,
) -> list[dict[str, Any]]:
    """Returns the seconds of a control step of one environment, for each number of them.

    All sides take turns, so that costs compare across numbers as well; a peer that is not there
    is left out.
    """
    present = [side for side in sides if not interpreters.missing(side[1].interpreter)]
    meters_in_turn = [meter for _, meter in present]
    rounds = pairing.measure_in_turn(meters_in_turn, interpreters, num_rounds, num_warm_up)
    growth = []
    for (num_envs, meter), costs in zip(present, zip(*rounds, strict=True), strict=True):
        cost = pairing.Quartiles.of(costs)
        quartiles = [cost.lower, cost.upper]
        growth.append({'label': meter.label, 'num_envs': num_envs, 'cost': cost.median,
                       'quartiles': quartiles})  # fmt: skip
    return growth


def describe_machine() -> dict[str, Any]:
    """Returns what the results depend on."""
    return {
        'system': platform.system(),
        'architecture': platform.machine(),
        'processors': num_processors(),
        'python': platform.python_version(),
        'packages': {name: metadata.version(name) for name in _PACKAGES},
    }
