"""Runs the benchmarks: `python -m benchmarks`; `make bench` installs what they compare with."""

import argparse
import json
import pathlib
import sys
from collections.abc import Sequence
from typing import Any

from benchmarks import meters, plot, report, results
from benchmarks import rows as row_lib

_PAIRS, _WARM_UP = 30, 2
_QUICK_PAIRS, _QUICK_WARM_UP = 1, 0
_PLOT = 'num_envs.png'


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='python -m benchmarks', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='few rounds, and no peers')
    parser.add_argument('--pairs', type=int, default=_PAIRS, help='pairs of rounds in a row')
    parser.add_argument('--only', default='', help='one group of rows, growth or breakdown')
    parser.add_argument('--output_dir', type=pathlib.Path, default=pathlib.Path('build/bench'))
    parser.add_argument(
        '--write',
        type=pathlib.Path,
        nargs='+',
        default=[],
        metavar='PAGE',
        help='pages whose tables and plot are replaced, if every row was measured',
    )
    for peer in row_lib.PEERS:
        parser.add_argument(f'--{peer}', metavar='PYTHON', help=f'a Python that has {peer}')
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> None:
    """Measures, prints the tables, and writes them and the plot."""
    options = _parse(arguments)
    for page in options.write:
        report.tables_of(page)  # A page without a place for them is named before minutes are spent.
    rows, breakdowns = row_lib.all_rows(), row_lib.breakdowns()
    growth_sides = row_lib.growth_sides()
    num_pairs, num_warm_up = options.pairs, _WARM_UP
    if options.quick:
        rows, breakdowns = row_lib.quick_rows(), breakdowns[::2]  # One convention.
        growth_sides = row_lib.growth_sides((1, 8))
        num_pairs, num_warm_up = _QUICK_PAIRS, _QUICK_WARM_UP
    interpreters = meters.Interpreters({peer: getattr(options, peer) for peer in row_lib.PEERS})
    measured: dict[str, Any] = {'machine': results.describe_machine(), 'rows': []}
    if options.only in ('', 'breakdown'):
        _say('where the time goes')
        measured['breakdowns'] = [
            results.measure_breakdown(each, interpreters, num_pairs, num_warm_up)
            for each in breakdowns
        ]
    for row in rows:
        if options.only in ('', row.group):
            _say(f'{row.ours.label} against {row.peer.label}')
            measured['rows'].append(results.measure_row(row, interpreters, num_pairs, num_warm_up))
    if options.only in ('', 'growth'):
        _say('growth with the number of environments')
        measured['growth'] = results.measure_growth(
            growth_sides, interpreters, max(3, num_pairs // 3), num_warm_up
        )
    _write(measured, options.output_dir)
    _write_pages(measured, options.write)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _write(measured: dict[str, Any], output_dir: pathlib.Path) -> None:
    if measured['rows']:
        print(report.table(measured))
    if 'breakdowns' in measured:
        print(f'\n{report.breakdown(measured)}')
    output_dir.mkdir(parents=True, exist_ok=True)
    written = [output_dir / 'results.json']
    written[0].write_text(json.dumps(measured, indent=2) + '\n', encoding='utf-8')
    if 'growth' in measured:
        written.append(output_dir / _PLOT)
        plot.save(measured, written[-1])
    print(f'\nWritten: {", ".join(map(str, written))}')


def _write_pages(measured: dict[str, Any], pages: Sequence[pathlib.Path]) -> None:
    """Replaces the tables of pages, and a plot beside them, if every row was measured."""
    if not pages:
        return
    if not report.is_complete(measured):
        print(f'Left as they were, for want of some rows: {", ".join(map(str, pages))}')
        return
    for page in pages:
        report.write_page(measured, page)
        picture = page.parent / _PLOT
        if 'growth' in measured and picture.exists():
            plot.save(measured, picture)
        print(f'Written: {page}')


if __name__ == '__main__':
    main()
