"""Results as text."""

import pathlib
from collections.abc import Sequence
from typing import Any

from benchmarks import markdown

# What the pages' markers say.
SPEED_TABLE = 'speed table: made by make bench'
SPEED_SUMMARY = 'speed summary: made by make bench'

# Rows of the summary: group, our side, the other side.
HEADLINES = (
    ('single', 'documented, dm_env', 'Gymnasium-Robotics FetchPush-v4'),
    ('single', '-v4, gym.make', 'Gymnasium-Robotics FetchPush-v4'),
    ('single', 'documented, dm_env', 'bare mj_step(nstep=20)'),
    ('batch', 'batch of 64', 'EnvPool FetchPush-v4'),
    ('batch', 'batch of 64', 'bare mujoco.rollout'),
    ('start-up', 'import, load, reset', 'Gymnasium-Robotics FetchPush-v4'),
    ('memory', 'documented, dm_env', 'Gymnasium-Robotics FetchPush-v4'),
)

_PAGE_COLUMNS = ('', 'fetch_composer', 'against', 'ratio (quartiles)', 'ours', 'theirs')

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


def is_complete(results: dict[str, Any]) -> bool:
    """Returns whether every row was measured: all of the summary are there, and none is skipped."""
    rows = results['rows']
    return set(HEADLINES) <= {_key(row) for row in rows} and not any('skipped' in r for r in rows)


def markdown_tables(results: dict[str, Any]) -> dict[str, str]:
    """Returns the tables of pages, by what their markers say; every row must have been measured."""
    rows = {_key(row): row for row in results['rows']}
    return {
        SPEED_TABLE: f'{_markdown_table(results["rows"])}\n\n{_setting(results["machine"])}',
        SPEED_SUMMARY: _markdown_table([rows[key] for key in HEADLINES]),
    }


def tables_of(page: pathlib.Path) -> list[str]:
    """Returns what the markers of a page say, of those for which there is a table.

    Raises:
        ValueError: if there is none; the message names the markers.
    """
    names = (SPEED_TABLE, SPEED_SUMMARY)
    found = [name for name in names if markdown.has_markers(page, name)]
    if not found:
        markers = ' or '.join(f'<!-- {name} -->' for name in names)
        raise ValueError(f'{page} must have the line {markers}, once, and <!-- end --> after it.')
    return found


def write_page(results: dict[str, Any], page: pathlib.Path) -> None:
    """Replaces the tables of a page; every row must have been measured.

    Raises:
        ValueError: as `tables_of` does.
    """
    tables = markdown_tables(results)
    for name in tables_of(page):
        markdown.write_between_markers(page, name, tables[name])


def _key(row: dict[str, Any]) -> tuple[str, str, str]:
    return row['group'], row['ours'], row['peer']


def _markdown_table(rows: Sequence[dict[str, Any]]) -> str:
    lines = []
    for row in rows:
        lower, upper = map(_ratio, row['ratio_quartiles'])
        quantity = ', '.join(dict.fromkeys((row['group'], row['quantity'])))
        ratio = f'**{_ratio(row["ratio"])}** ({lower}–{upper})'
        costs = _absolute(row['our_cost'], row), _absolute(row['peer_cost'], row)
        lines.append((quantity, row['ours'], row['peer'], ratio, *costs))
    return markdown.table(_PAGE_COLUMNS, lines)


def _setting(machine: dict[str, Any]) -> str:
    """Says where and with what the rows were measured."""
    packages = ', '.join(f'{name} {version}' for name, version in machine['packages'].items())
    return (
        f'Measured on {machine["processors"]} processors ({machine["system"]}, '
        f'{machine["architecture"]}) with Python {machine["python"]}, {packages}.'
    )


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
