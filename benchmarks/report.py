"""Results as text."""

from collections.abc import Sequence
from typing import Any

_COLUMNS = ('', 'ours', 'against', 'ratio', 'quartiles', 'goal', '', 'ours', 'theirs')


def _absolute(cost: float, row: dict[str, Any]) -> str:
    if row['quantity'] == 'speed':
        return f'{1 / cost:,.0f} steps/s'
    if row['unit'] == 'B':
        return f'{cost / 2**20:.1f} MiB' if cost > 2**20 else f'{cost / 2**10:.0f} KiB'
    return f'{cost:.2f} s' if cost > 0.1 else f'{cost * 1e6:.0f} µs'


def _ratio(ratio: float) -> str:
    return f'{ratio:.2f}' if ratio >= 0.1 else f'{ratio:.2g}'


def _cells(row: dict[str, Any]) -> Sequence[str]:
    goal = ''
    if row['goal'] is not None:
        goal = f'{"≥" if row["quantity"] == "speed" else "≤"} {row["goal"]:.2f}'
    quantity = f'{row["group"]}, {row["quantity"]}'
    if 'skipped' in row:
        reason = row['skipped'].splitlines()[0]
        return quantity, row['ours'], row['peer'], f'SKIPPED: {reason}', '', goal, '', '', ''
    lower, upper = row['ratio_quartiles']
    return (
        quantity,
        row['ours'],
        row['peer'],
        _ratio(row['ratio']),
        f'{_ratio(lower)} to {_ratio(upper)}',
        goal,
        {True: 'reached', False: 'MISSED', None: ''}[row['reached']],
        _absolute(row['our_cost'], row),
        _absolute(row['peer_cost'], row),
    )


def _aligned(lines: Sequence[Sequence[str]]) -> str:
    widths = [max(len(cell) for cell in column) for column in zip(*lines, strict=True)]
    return '\n'.join(
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def table(results: dict[str, Any]) -> str:
    """Returns the table of ratios: ours over the peer's, medians of pairs."""
    return _aligned([_COLUMNS, *(_cells(row) for row in results['rows'])])


def breakdown(results: dict[str, Any]) -> str:
    """Returns where the time of a control step goes."""
    blocks = []
    for each in results['breakdowns']:
        lines: list[Sequence[str]] = [(f'{each["label"]}:', f'{each["whole"]:.1f} µs', '')]
        for part, microseconds in each['parts'].items():
            share = microseconds / each['whole']
            lines.append((f'  {part}', f'{microseconds:.1f} µs', f'{share:.1%}'))
        blocks.append(_aligned(lines))
    return '\n\n'.join(blocks)
