"""Measures rows and takes control steps apart; the results are plain enough for JSON."""

import platform
from collections.abc import Callable, Iterable
from typing import Any

from benchmarks import meters, pairing
from benchmarks.rows import Breakdown, Row, num_processors

_MIN_PAIRS = 3


def measure_row(
    row: Row, interpreters: meters.Interpreters, num_pairs: int, num_warm_up: int
) -> dict[str, Any]:
    """Returns what a row came to; a peer that is not there, or fails, is said to be skipped."""
    result = {
        'group': row.group,
        'ours': row.ours.label,
        'peer': row.peer.label,
        'quantity': row.quantity,
        'num_envs': row.num_envs,
        'unit': row.unit,
        'goal': row.goal,
    }
    if interpreters.missing(row.peer.interpreter):
        return {**result, 'skipped': f'{row.peer.interpreter} is not installed'}
    count = max(_MIN_PAIRS, round(row.pairs * num_pairs))
    discarded = num_warm_up if row.warms_up else 0
    try:
        pairs = pairing.measure_pairs(row.ours, row.peer, interpreters, count, discarded)
    except meters.WorkerError as error:
        if row.peer.interpreter == meters.OWN:
            raise
        return {**result, 'skipped': str(error)}
    ratio = pairing.Quartiles.of([row.ratio(*pair) for pair in pairs])
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


def measure_all(
    rows: Iterable[Row],
    breakdowns: Iterable[Breakdown],
    interpreters: meters.Interpreters,
    num_pairs: int,
    num_warm_up: int,
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """Returns the results of all rows and breakdowns, and of which machine they are.

    Args:
        rows: What is compared.
        breakdowns: What is taken apart.
        interpreters: Where it runs.
        num_pairs: How many pairs of rounds are kept, at a row's default.
        num_warm_up: How many rounds are discarded first.
        progress: Called with what is measured next.
    """
    measured_rows, measured_breakdowns = [], []
    for row in rows:
        progress(f'{row.ours.label} against {row.peer.label}')
        measured_rows.append(measure_row(row, interpreters, num_pairs, num_warm_up))
    for breakdown in breakdowns:
        progress(f'where the time goes: {breakdown.label}')
        measured_breakdowns.append(
            measure_breakdown(breakdown, interpreters, num_pairs, num_warm_up)
        )
    machine = {
        'system': platform.system(),
        'architecture': platform.machine(),
        'processors': num_processors(),
        'python': platform.python_version(),
    }
    return {'machine': machine, 'rows': measured_rows, 'breakdowns': measured_breakdowns}
