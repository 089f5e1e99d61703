"""Tries hostile input for as long as one likes, and writes down what held and what did not."""

import argparse
import os
import pathlib
import platform
import tempfile
import time
import traceback
from collections.abc import Callable

# Chosen before anything that asks for it is imported; nothing here takes a picture.
os.environ.setdefault('MUJOCO_GL', 'disabled')

from benchmarks import markdown  # noqa: E402
from fetch_composer.explorer.episodes import provenance  # noqa: E402
from tests.hostile import endurance, faces, stores  # noqa: E402
from tests.hostile.tally import Tally  # noqa: E402

TABLE = 'soak table: made by make soak'
_HEADER = ('tried', 'times', 'refused by name', 'defects')
_ROUND = 200  # Examples, in each of the faces ...
_OTHERS = {stores.kills: 3, endurance.leaks: 30}  # ... and how many of what is slower.
_FEW = 10
_MOST_DEFECTS = 100  # Of one kind, after which it is not tried further.

Check = Callable[[Tally, int, int], None]


def soak(seconds: float, seed: int, folder: pathlib.Path) -> dict[str, Tally]:
    """Tries every kind in turns until the time is up.

    Args:
        seconds: For how long; every kind gets its share.
        seed: Of the first round; the next ones count up.
        folder: Where a text is written for each defect.

    Returns:
        How each kind went.
    """
    kinds: dict[str, tuple[Check, int]] = {
        **{name: (check, _ROUND) for name, check in faces.ALL.items()},
        **{
            name: (check, _OTHERS.get(check, _FEW))
            for name, check in {**stores.ALL, **endurance.ALL}.items()
        },
    }
    tallies, spent = {name: Tally() for name in kinds}, dict.fromkeys(kinds, 0.0)
    end = time.monotonic() + seconds
    rounds = dict.fromkeys(kinds, seed)
    while time.monotonic() < end:
        going = [name for name in kinds if len(tallies[name].defects) < _MOST_DEFECTS]
        if not going:
            break
        name = min(going, key=spent.__getitem__)  # So that all have the same time.
        check, count = kinds[name]
        started = time.monotonic()
        try:
            check(tallies[name], rounds[name], count)
        except Exception:
            defect = f'{name}, round {rounds[name]}\n{traceback.format_exc()}'
            tallies[name].defects.append(defect)
            number = sum(len(each.defects) for each in tallies.values())
            (folder / f'defect_{number:03d}.txt').write_text(defect, encoding='utf-8')
            print(f'DEFECT in {name}: {folder}/defect_{number:03d}.txt', flush=True)
        rounds[name] += 1
        spent[name] += time.monotonic() - started
    return tallies


def table(tallies: dict[str, Tally], seconds: float, seed: int) -> str:
    """Returns what a page says of it."""
    rows = [
        (name, f'{each.tried:,}', f'{each.refused:,}', str(len(each.defects)))
        for name, each in tallies.items()
    ]
    versions = provenance.versions()
    return (
        f'{markdown.table(_HEADER, rows)}\n\n'
        f'{seconds / 60:.0f} minutes, seed {seed}, {platform.system()}, Python '
        f'{versions["python"]}, mujoco {versions["mujoco"]}, numpy {versions["numpy"]}: '
        f'`make soak SOAK_OPTIONS="--minutes {seconds / 60:.0f} --seed {seed}"`.'
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=60, help='for how long')
    parser.add_argument('--seed', type=int, default=0, help='seed of the first round')
    parser.add_argument('--write', type=pathlib.Path, help='a page with a place for the table')
    options = parser.parse_args()
    if options.write is not None and not markdown.has_markers(options.write, TABLE):
        parser.error(f'{options.write} has no place for the table: <!-- {TABLE} -->')
    folder = pathlib.Path(tempfile.mkdtemp(prefix='soak_'))
    started = time.monotonic()
    tallies = soak(60 * options.minutes, options.seed, folder)
    text = table(tallies, time.monotonic() - started, options.seed)
    print(text)
    if options.write is not None:
        markdown.write_between_markers(options.write, TABLE, text)
    return int(any(each.defects for each in tallies.values()))


if __name__ == '__main__':
    raise SystemExit(main())
