"""Makes datasets of graded skill for each task, and writes the card of docs/datasets.md.

`python -m docs.make_datasets` (`make datasets`) takes a minute or two for each. Stopped, it goes on
where it was: datasets of this very code and these versions are not made again.
"""

import argparse
import pathlib
import shlex
import subprocess
import sys
from typing import Any

from benchmarks import markdown
from docs import make_results
from fetch_composer.explorer import files
from fetch_composer.explorer.datasets import formats
from fetch_composer.explorer.episodes import provenance, seeds
from fetch_composer.explorer.results import writing

TABLE = 'datasets: made by make datasets'
HEADER = ('dataset', 'seeds', 'success (%)', 'return', 'MB')
# The flags of each kind. Its episodes have seeds of their own, so that kinds can be joined.
KINDS = {
    'expert': ('--policy=expert',),
    'medium': ('--mixture=expert:0.5,random:0.5',),
    'noisy': ('--policy=expert', '--noise=0.2'),
    'random': ('--policy=random',),
}
EPISODES = 1000

_PAGE = pathlib.Path(__file__).parent / 'datasets.md'
_NONE_MADE = ('', 'not measured yet', '', '')

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--runs', type=pathlib.Path, default='output/datasets', help='their folder')
parser.add_argument('--page', type=pathlib.Path, default=_PAGE, help='the page to write into')
parser.add_argument('--tasks', nargs='+', default=make_results.TASKS)
parser.add_argument('--format', choices=formats.FORMATS, default='minari')
parser.add_argument('--episodes', type=int, default=EPISODES)


def _target(args: argparse.Namespace, name: str) -> str:
    places = {
        'minari': f'fetch/{name}-v0',
        'ogbench': f'ogbench:{args.runs}/{name}.npz',
        'lerobot': f'lerobot:{args.runs}/lerobot_{name}',
    }
    return places[args.format]


def _flags(kind: str, episodes: int) -> list[str]:
    first = seeds.TRAINING.start + list(KINDS).index(kind) * EPISODES
    return [*KINDS[kind], f'--seed={first}', f'--episodes={episodes}']


def _make(args: argparse.Namespace, task: str, kind: str) -> None:
    """Makes a dataset, unless it is there."""
    folder = args.runs / f'{task}_{kind}'
    target = _target(args, f'{task}-{kind}')
    summary = files.load_json(folder / writing.SUMMARY)
    origin = {'versions': provenance.versions(), 'code': provenance.code_digest()}
    is_same = all(summary.get(name) == each for name, each in origin.items())
    if is_same and None not in formats.dataset(target).found():
        return
    flags = [f'--task={task}', *_flags(kind, args.episodes), '--films=none']
    flags += [f'--dataset={target}', f'--output_dir={folder}']
    command = ['python', '-m', 'fetch_composer.explorer', *flags]
    print(shlex.join(command), flush=True)
    subprocess.run([sys.executable, *command[1:]], check=True)


def _row(args: argparse.Namespace, task: str, kind: str) -> list[str]:
    """Returns the row of a dataset; one that says so of a dataset that is not there."""
    target = _target(args, f'{task}-{kind}')
    summary = files.load_json(args.runs / f'{task}_{kind}' / writing.SUMMARY)
    path = formats.dataset(target).path
    if not summary or not path.exists():
        return [f'`{target}`', *_NONE_MADE]
    low, high = summary['success_interval']
    return [
        f'`{target}`',
        f'{summary["episodes"][0]["seed"]}–{summary["episodes"][-1]["seed"]}',
        f'{100 * summary["success_rate"]:.1f} ({100 * low:.1f}–{100 * high:.1f})',
        f'{summary["return"]["mean"]:.1f}',
        f'{_size(path) / 1e6:.0f}',
    ]


def _size(path: pathlib.Path) -> int:
    """Returns the bytes of a dataset: of a folder, or of a file and those named after it."""
    inside = path.rglob('*') if path.is_dir() else path.parent.glob(f'{path.stem}*')
    return sum(each.stat().st_size for each in inside if each.is_file())


def main(args: argparse.Namespace) -> None:
    for task in args.tasks:
        for kind in KINDS:
            _make(args, task, kind)
    rows: list[Any] = [_row(args, task, kind) for task in make_results.TASKS for kind in KINDS]
    named = ', '.join(f'{name} {each}' for name, each in provenance.versions().items() if each)
    kinds = [(kind, f'`{" ".join(flags)}`') for kind, flags in KINDS.items()]
    tables = (markdown.table(('kind', 'flags'), kinds), markdown.table(HEADER, rows))
    text = '\n\n'.join((*tables, f'Made with {named}.'))
    markdown.write_between_markers(args.page, TABLE, text)
    print(f'Wrote {args.page}.')


if __name__ == '__main__':
    main(parser.parse_args())
