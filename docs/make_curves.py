"""Learns every task with several seeds, and writes the curves and figures of docs/learning.md, and
the table of docs/policies.md.

`python -m docs.make_curves` (`make curves`) takes most of a day. Stopped, it goes on where it
was: runs that are finished are not made again, unless settings have changed. `--kind frugal` makes
runs of few control steps, and `--kind timed` such as end after some minutes: these tell nothing
where other work is done meanwhile. `--draw` learns nothing and only writes what is there.
"""

import argparse
import dataclasses
import itertools
import pathlib
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib import figure

from benchmarks import markdown
from fetch_composer import policies, tasks
from fetch_composer.explorer import files
from fetch_composer.explorer.pictures import style
from fetch_composer.learning import curve, settings, train

_DOCS = pathlib.Path(__file__).parent
_DATA = _DOCS / 'curves'
_POLICIES = pathlib.Path(policies.__file__).parent / 'trained'
_CURVES_TABLE = 'curves table: made by make curves'
_TIMED_TABLE = 'timed table: made by make curves'
_FRUGAL_TABLE = 'frugal table: made by make curves'
_POLICIES_TABLE = 'policies table: made by make curves'

_TASKS = ('reach', 'push', 'pick_and_place', 'slide', 'push_around')
_COLOURS = {'documented': style.SUCCESS, 'gymnasium_robotics': style.FAILURE}
# Of the processor: a machine that does other work as well does not change them.
_AXES = {'environment_steps': 'environment steps', 'cpu_minutes': 'minutes of the processor'}
_SOLVED = 0.95
# Of `--kind timed`.
_MINUTES = {'reach': 1, 'push': 5, 'pick_and_place': 5, 'slide': 60, 'push_around': 30}
_FORMS = {
    'environment_steps': '{:,.0f}',
    'minutes': '{:.1f}',
    'cpu_minutes': '{:.1f}',
    'success_rate': '{:.3f}',
}
_GRID = 200  # Places at which the curves of several seeds are compared.

_parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
_parser.add_argument('--seeds', type=int, nargs='+', default=[0, 1, 2])
_parser.add_argument('--runs', type=pathlib.Path, default='output/curves', help='their folder')
_parser.add_argument('--tasks', nargs='+', choices=_TASKS, default=_TASKS)
_parser.add_argument('--kind', choices=('whole', 'timed', 'frugal'), default='whole')
_parser.add_argument('--draw', action='store_true', help='learn nothing')


def _learn(args: argparse.Namespace) -> None:
    """Makes the runs that are not finished, and keeps the curve and the figures of each."""
    kind, frugal = _suffix(args.kind), args.kind == 'frugal'
    for seed, (task, convention) in itertools.product(args.seeds, _forms(args.tasks)):
        name = f'{task}_{convention}{kind}_seed{seed}'
        if _has_usual_settings(files.load_json(_DATA / f'{name}.json'), task, frugal):
            continue
        print(name, flush=True)
        output = args.runs / name
        words = [sys.executable, '-m', 'fetch_composer.learning', f'--task={task}']
        words += [f'--convention={convention}', f'--seed={seed}', '--no-report']
        words.append(f'--output_dir={output}')
        if frugal:
            words.append('--frugal')
        if args.kind == 'timed':
            words.append(f'--minutes={_MINUTES[task]}')
        subprocess.run(words, check=True)
        keep(output, name)


def _forms(names: Sequence[str]) -> list[tuple[str, str]]:
    """Returns task and convention of each form that these tasks have."""
    return [(task, convention) for task in names for convention in tasks.conventions_of(task)]


def _suffix(kind: str) -> str:
    """Returns what the names of runs of this kind have before their seed."""
    return '' if kind == 'whole' else f'_{kind}'


def _has_usual_settings(summary: dict, task: str, frugal: bool = False) -> bool:
    """Returns whether a run is finished, and was made as `--task` makes it."""
    if not summary:
        return False
    return _settings(summary) == settings.for_task(task, frugal)


def _settings(summary: dict) -> settings.Settings:
    made = summary['settings']
    return settings.Settings(**{**made, 'hidden': tuple(made['hidden'])})


def learned() -> dict[pathlib.Path, dict]:
    """Returns the file and the figures of each run, and of each policy that was learned."""
    paths = sorted((*_DATA.glob('*.json'), *_POLICIES.glob('*.json')))
    summaries = {path: files.load_json(path) for path in paths}
    return {path: each for path, each in summaries.items() if 'settings' in each}


def command(summary: dict) -> str:
    """Returns the command that makes a run today, when defaults may be others than they were."""
    options = train.Options(
        **{name: summary[name] for name in ('task', 'convention', 'seed')},
        settings=_settings(summary),
        minutes=summary['minutes_limit'],
        output_dir=_DATA,
    )
    return options.command


def keep(run: pathlib.Path, name: str) -> None:
    """Copies curve and figures of a finished run to where the page is made from."""
    shutil.copyfile(run / 'curve.csv', _DATA / f'{name}.csv')
    shutil.copyfile(run / 'summary.json', _DATA / f'{name}.json')


def _finished(
    task: str, convention: str, kind: str = 'whole'
) -> list[tuple[dict, list[curve.Point]]]:
    """Returns summary and curve of each finished run, in the order of their seeds."""
    paths = _DATA.glob(f'{task}_{convention}{_suffix(kind)}_seed*.json')
    runs = [(files.load_json(path), curve.load(path.with_suffix('.csv'))) for path in paths]
    return sorted(runs, key=lambda run: run[0]['seed'])


def _draw() -> None:
    """Draws success against control steps and against minutes; a row for each task with a run."""
    drawn = [task for task in _TASKS if any(_finished(task, each) for each in _COLOURS)]
    canvas = figure.Figure(figsize=(9, 2.6 * len(drawn)), dpi=110, layout='constrained')
    rows = canvas.subplots(len(drawn), 2, sharey=True, squeeze=False)
    for task, axes_of_row in zip(drawn, rows, strict=True):
        for axes, (place, label) in zip(axes_of_row, _AXES.items(), strict=True):
            for convention, colour in _COLOURS.items():
                curves = [points for _, points in _finished(task, convention)]
                if curves:
                    _draw_curves(axes, curves, place, colour, f'{convention} ({len(curves)})')
            curve.decorate(axes, label)
            axes.locator_params(axis='x', nbins=6)
            axes.xaxis.set_major_formatter('{x:,.8g}')
        axes_of_row[0].set_ylabel(task)
        if axes_of_row[1].lines:
            axes_of_row[1].legend(loc='lower right', edgecolor='none', fontsize=8)
    with files.whole_file(_DOCS / 'learning.png') as partial:
        canvas.savefig(partial, facecolor=style.PAPER)


def _draw_curves(axes, curves, place: str, colour: str, label: str) -> None:
    """Draws the median of several seeds and, as a band, their range."""
    ends = [getattr(points[-1], place) for points in curves]
    places = np.linspace(0, min(ends), _GRID)
    lines = [
        np.interp(
            places,
            [0, *(getattr(point, place) for point in points)],
            [0, *(point.success for point in points)],
        )
        for points in curves
    ]
    axes.plot(places, np.median(lines, axis=0), color=colour, label=label)
    axes.fill_between(places, np.min(lines, axis=0), np.max(lines, axis=0), color=colour, alpha=0.2)


def _table() -> str:
    """Returns a row of figures for each task and convention."""
    header = ('task', 'convention', 'seeds', f'{_SOLVED:.0%} after steps', 'processor minutes')
    header += ('at the end', 'steps in all', 'processor minutes in all')
    rows = []
    for task, convention, ends, solved in _groups('whole'):
        others = sum(not _has_usual_settings(end, task) for end in ends)
        seeds = f'{len(ends)}, {others} with other settings' if others else f'{len(ends)}'
        first = (_spread('environment_steps', solved), _spread('cpu_minutes', solved))
        last = (
            _spread(name, ends) for name in ('success_rate', 'environment_steps', 'cpu_minutes')
        )
        rows.append((task, convention, seeds, *first, *last))
    return markdown.table(header, rows)


def _timed() -> str:
    """Returns a row of figures for each task and convention with runs of this kind."""
    header = ('task', 'convention', 'seeds', f'{_SOLVED:.0%} after minutes')
    header += ('ended after', 'held-out')
    rows = []
    for task, convention, ends, solved in _groups('timed'):
        if ends:
            seeds = ', '.join(str(end['seed']) for end in ends)
            last = (_spread('minutes', ends), _spread('success_rate', ends))
            rows.append((task, convention, seeds, _spread('minutes', solved), *last))
    return markdown.table(header, rows)


def _frugal() -> str:
    """Returns a row of figures for each run with `--frugal`."""
    header = ('task', 'convention', 'seed', f'{_SOLVED:.0%} after steps')
    header += ('at the end', 'steps in all', 'minutes of the processor')
    rows = []
    for task, convention, ends, solved in _groups('frugal'):
        for end, point in zip(ends, solved, strict=True):
            first = _spread('environment_steps', [point])
            last = (
                _spread(name, [end])
                for name in ('success_rate', 'environment_steps', 'cpu_minutes')
            )
            rows.append((task, convention, str(end['seed']), first, *last))
    return markdown.table(header, rows)


def _groups(kind: str) -> Iterator[tuple[str, str, list[dict], list[dict | None]]]:
    """Yields what was run for each task and convention.

    Yields:
        Task, convention, the figures at the end of each finished run, and those of the first
        point of its curve at which it is solved: None if it never is.
    """
    for task, convention in _forms(_TASKS):
        runs = _finished(task, convention, kind)
        solved = [_first_solved(points) for _, points in runs]
        yield (
            task,
            convention,
            [summary for summary, _ in runs],
            [point and dataclasses.asdict(point) for point in solved],
        )


def _first_solved(points: Sequence[curve.Point]) -> curve.Point | None:
    return next((point for point in points if point.success >= _SOLVED), None)


def _spread(name: str, figures: Sequence[dict | None]) -> str:
    """Returns the median and, of several that differ, the range; `not` for one that is missing."""
    if not figures:
        return ''
    known = [np.inf if each is None else each[name] for each in figures]
    middle, least, most = (
        'not' if np.isinf(value) else _FORMS[name].format(value)
        for value in (np.median(known), min(known), max(known))
    )
    return middle if least == most else f'{middle} ({least} to {most})'


def _policies() -> str:
    """Returns a row for each policy that ships, from its card."""
    header = ('task', 'convention', 'success of 1,000', 'interval', 'steps', 'minutes')
    header += ('of the processor', 'how')
    rows = []
    for task, convention in _forms(_TASKS):
        card = files.load_json(_POLICIES / f'{task}_{convention}.json')
        if card:
            low, high = card['success_interval']
            names = ('environment_steps', 'minutes')
            rows.append(
                (
                    task,
                    convention,
                    _spread('success_rate', [card]),
                    f'{low:.3f} to {high:.3f}',
                    *(_spread(name, [card]) for name in names),
                    str(card.get('cpu_minutes', '')),
                    card['method'].split(',')[0].split(' by ')[0],
                )
            )
    return markdown.table(header, rows)


def main(args: argparse.Namespace) -> None:
    _DATA.mkdir(exist_ok=True)
    if not args.draw:
        _learn(args)
    for path, summary in learned().items():
        files.save_json(path, {**summary, 'command': command(summary)})
    _draw()
    markdown.write_between_markers(_DOCS / 'learning.md', _CURVES_TABLE, _table())
    markdown.write_between_markers(_DOCS / 'learning.md', _TIMED_TABLE, _timed())
    markdown.write_between_markers(_DOCS / 'learning.md', _FRUGAL_TABLE, _frugal())
    markdown.write_between_markers(_DOCS / 'policies.md', _POLICIES_TABLE, _policies())


if __name__ == '__main__':
    main(_parser.parse_args())
