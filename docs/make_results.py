"""Makes the standard evaluations, and writes the table of docs/results.md.

`python -m docs.make_results` (`make results`) takes some minutes. Stopped, it goes on where it was:
evaluations of this very code and these versions are not made again.
"""

import argparse
import pathlib
import shlex
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from benchmarks import markdown
from fetch_composer import policies, tasks
from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import provenance
from fetch_composer.explorer.results import standard, writing

TABLE = 'standard evaluation: made by make results'

_PAGE = pathlib.Path(__file__).parent / 'results.md'
_TRAINED = pathlib.Path(policies.__file__).parent / 'trained'
TASKS = ('reach', 'push', 'slide', 'pick_and_place', 'push_around', 'push_two', 'stack')
_POLICIES = ('random', 'expert', 'trained')

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--runs', type=pathlib.Path, default='output/results', help='their folder')
parser.add_argument('--page', type=pathlib.Path, default=_PAGE, help='the page to write into')
parser.add_argument('--tasks', nargs='+', default=TASKS)


def _evaluate(folder: pathlib.Path, task: str, convention: str) -> dict[str, Any]:
    """Returns the summary of an evaluation, which is made unless it is there."""
    path = folder / f'{task}_{convention}'
    summary = files.load_json(path / writing.SUMMARY)
    origin = {'versions': provenance.versions(), 'code': provenance.code_digest()}
    if 'standard' in summary and all(summary.get(name) == origin[name] for name in origin):
        return summary
    flags = [f'--task={task}', f'--convention={convention}', f'--output_dir={path}']
    flags += [f'--policy={each}' for each in _POLICIES if _is_there(each, task, convention)]
    command = ['python', '-m', 'fetch_composer.explorer', '--standard', *flags]
    print(shlex.join(command), flush=True)
    subprocess.run([sys.executable, *command[1:]], check=True)
    return files.load_json(path / writing.SUMMARY)


def _is_there(policy: str, task: str, convention: str) -> bool:
    return policy != 'trained' or (_TRAINED / f'{task}_{convention}.onnx').is_file()


def _rows(summary: dict[str, Any], task: str, convention: str) -> list[list[str]]:
    """Returns the rows of an evaluation, and one that says so for a policy that there is not."""
    rows = list(summary['standard'])
    missing = [each for each in _POLICIES if not _is_there(each, task, convention)]
    empty = [''] * (len(standard.HEADER) - 4)
    return rows + [[task, convention, each, 'none ships', *empty] for each in missing]


def _text(rows: Sequence[Sequence[str]], versions: dict[str, str | None]) -> str:
    named = ', '.join(f'{name} {each}' for name, each in versions.items() if each)
    return f'{markdown.table(standard.HEADER, rows)}\n\nMade with {named}.'


def main(args: argparse.Namespace) -> None:
    rows, versions = [], provenance.versions()
    for task in args.tasks:
        for convention in tasks.conventions_of(task):
            summary = _evaluate(args.runs, task, convention)
            rows += _rows(summary, task, convention)
    markdown.write_between_markers(args.page, TABLE, _text(rows, versions))
    print(f'Wrote {args.page}.')


if __name__ == '__main__':
    main(parser.parse_args())
