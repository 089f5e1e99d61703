"""Runs the benchmarks: `python -m benchmarks`, or `make bench` with the peers installed."""

import argparse
import json
import pathlib
import sys

from benchmarks import meters, plot, report, results
from benchmarks import rows as row_lib

_PAIRS, _WARM_UP = 30, 2
_QUICK_PAIRS, _QUICK_WARM_UP = 3, 1


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='python -m benchmarks', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='few rounds, and no peers')
    parser.add_argument('--pairs', type=int, default=_PAIRS, help='pairs of rounds in a row')
    parser.add_argument('--only', default='', help='only rows whose group is this')
    parser.add_argument('--output_dir', type=pathlib.Path, default=pathlib.Path('build/bench'))
    for peer in row_lib.PEERS:
        parser.add_argument(f'--{peer}', metavar='PYTHON', help=f'a Python that has {peer}')
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> None:
    """Measures, prints the tables, and writes them and the plot."""
    options = _parse(arguments)
    rows, breakdowns = row_lib.all_rows(), row_lib.breakdowns()
    num_pairs, num_warm_up = options.pairs, _WARM_UP
    if options.quick:
        rows, breakdowns = row_lib.quick_rows(), breakdowns[:1]
        num_pairs, num_warm_up = _QUICK_PAIRS, _QUICK_WARM_UP
    rows = [row for row in rows if options.only in ('', row.group)]
    measured = results.measure_all(
        rows,
        [] if options.only else breakdowns,
        meters.Interpreters({peer: getattr(options, peer) for peer in row_lib.PEERS}),
        num_pairs,
        num_warm_up,
        progress=lambda text: print(text, file=sys.stderr, flush=True),
    )
    print(report.table(measured))
    print()
    print(report.breakdown(measured))
    options.output_dir.mkdir(parents=True, exist_ok=True)
    json_path = options.output_dir / 'results.json'
    json_path.write_text(json.dumps(measured, indent=2) + '\n', encoding='utf-8')
    plot_path = options.output_dir / 'num_envs.png'
    written = [json_path, plot_path] if plot.save(measured, plot_path) else [json_path]
    print(f'\nWritten: {", ".join(map(str, written))}')


if __name__ == '__main__':
    main()
