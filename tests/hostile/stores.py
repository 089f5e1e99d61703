"""Runs that are killed, and files of unfinished runs that are damaged: nothing is lost or wrong."""

import functools
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

import fetch_composer
from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import film
from fetch_composer.explorer.results import store
from tests import episodes, runs
from tests.hostile.tally import Tally

_KILLED = {'policy': ['random'], 'episodes': 200, 'max_episode_steps': 8, 'num_envs': 4}
_FILES = 50
_SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
_SECONDS_OF_WRITING = 2.0


def _arrays(folder: pathlib.Path) -> dict[str, np.ndarray]:
    with np.load(folder / 'trajectories.npz') as file:
        return dict(file)


def _assert_same(folder: pathlib.Path, arrays: dict[str, np.ndarray]) -> None:
    found = _arrays(folder)
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array, err_msg=name)


@functools.cache
def _uninterrupted() -> tuple[dict[str, np.ndarray], set[str]]:
    """Returns arrays and names of files of a run that nobody has killed."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        run = run_lib.Run(flags.make_options({**_KILLED, 'output_dir': temporary}), None)
        run.run()
        run.close()
        return _arrays(folder), runs.names(folder)


def _start(folder: pathlib.Path) -> subprocess.Popen:
    return subprocess.Popen(
        [
            sys.executable, runs.EXPLORE, f'--output_dir={folder}',
            *(f'--{name}={v[0] if isinstance(v, list) else v}' for name, v in _KILLED.items()),
        ],
        env=runs.environment(MUJOCO_GL='disabled'),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )  # fmt: skip


def _wait(process: subprocess.Popen, folder: pathlib.Path, count: int) -> None:
    """Waits until so many files of episodes are there, or the process has ended."""
    while process.poll() is None:
        if len(list(folder.glob(f'{store.NAME}/*/episodes*.npz'))) >= count:
            return
        time.sleep(0.01)


def kills(tally: Tally, seed: int, count: int) -> None:
    """Kills a run again and again, at its start, in between and as it writes; then lets it end."""
    generator = random.Random(seed)
    arrays, names = _uninterrupted()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        for _ in range(count):
            process = _start(folder)
            wanted = generator.choice((0, generator.randrange(_FILES), _FILES))
            _wait(process, folder, wanted)
            time.sleep(generator.uniform(0, _SECONDS_OF_WRITING if wanted == _FILES else 0.05))
            process.send_signal(generator.choice(_SIGNALS))
            process.communicate()
            tally.add(was_refused=False)
        process = _start(folder)
        _, said = process.communicate()
        assert process.returncode == 0, said.decode()
        _assert_same(folder, arrays)
        assert runs.names(folder) == names


def _options(folder: pathlib.Path):
    return flags.make_options(
        {
            'policy': ['random'], 'episodes': 9, 'max_episode_steps': 4, 'num_envs': 2,
            'width': 96, 'height': 64, 'output_dir': str(folder),
        }
    )  # fmt: skip


def _run(folder: pathlib.Path, stop_after: int | None = None, fresh: bool = False) -> None:
    run = run_lib.Run(_options(folder), None, fresh)
    add, left = run._store.add, [stop_after]

    def add_and_stop(*arguments) -> None:
        add(*arguments)
        if left[0] is not None:
            left[0] -= 1
            if left[0] == 0:
                signal.raise_signal(signal.SIGTERM)

    run._store.add = add_and_stop  # type: ignore[method-assign]
    try:
        run.run()
    finally:
        run.close()


@functools.cache
def _whole_and_unfinished() -> tuple[dict[str, np.ndarray], tempfile.TemporaryDirectory]:
    with tempfile.TemporaryDirectory() as folder:
        _run(pathlib.Path(folder))
        arrays = _arrays(pathlib.Path(folder))
    unfinished = tempfile.TemporaryDirectory()
    _run(pathlib.Path(unfinished.name), stop_after=3)
    return arrays, unfinished


def _damage(path: pathlib.Path, generator: random.Random) -> None:
    """Does to a file what disks, people and half-finished copies do."""
    content = bytearray(path.read_bytes())
    kind = generator.choice(('empty', 'cut', 'flip', 'zeros', 'words', 'other', 'gone', 'folder'))
    if kind == 'cut':
        content = content[: generator.randrange(len(content) + 1)]
    elif kind == 'flip' and content:
        for _ in range(generator.choice((1, 1, 8))):
            content[generator.randrange(len(content))] ^= 1 << generator.randrange(8)
    elif kind == 'zeros':
        content = bytearray(len(content))
    elif kind == 'words':
        content = bytearray(b'nothing of ours\n')
    elif kind == 'other':
        np.savez(path.with_suffix('.other.npz'), other=np.arange(3))
        path.with_suffix('.other.npz').replace(path)
        return
    elif kind in ('gone', 'folder'):
        path.unlink()
        if kind == 'folder':
            path.mkdir()
        return
    path.write_bytes(content if kind != 'empty' else b'')


def damaged_stores(tally: Tally, seed: int, count: int) -> None:
    """Damages files of an unfinished run, which then finishes as though nothing had been."""
    generator = random.Random(seed)
    arrays, unfinished = _whole_and_unfinished()
    for _ in range(count):
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary, 'run')
            shutil.copytree(unfinished.name, folder)
            found = sorted(
                path for path in (folder / store.NAME).rglob('*')
                if path.is_file()
            )  # fmt: skip
            for path in generator.sample(found, generator.choice((1, 1, 2))):
                _damage(path, generator)
            was_refused = False
            try:
                _run(folder)
            except ValueError as error:  # What says which run it is may be damaged, too.
                assert '--fresh' in str(error), f'names nothing: {error!r}'
                _run(folder, fresh=True)
                was_refused = True
            _assert_same(folder, arrays)
            assert not (folder / store.NAME).exists()
        tally.add(was_refused)


class _Camera:
    """A camera whose pictures cost nothing."""

    def picture(self) -> np.ndarray:
        return np.full((64, 96, 3), 100, np.uint8)


@functools.cache
def _film() -> tuple[tempfile.TemporaryDirectory, film.Film, Episode]:
    env = fetch_composer.load('push', max_episode_steps=4)
    episode = episodes.record(env, 'random', 5)
    folder = tempfile.TemporaryDirectory()
    camera = _Camera()
    taken = film.take(pathlib.Path(folder.name), episode, env, camera, 25, lambda step: None)
    env.close()
    return folder, taken, episode


def damaged_films(tally: Tally, seed: int, count: int) -> None:
    """Damages files of a film that has been kept, which is then taken again."""
    generator = random.Random(seed)
    original, taken, episode = _film()
    mp4 = taken.path.read_bytes()
    for _ in range(count):
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary, 'films')
            shutil.copytree(original.name, folder)
            _damage(generator.choice(sorted(folder.iterdir())), generator)
            kept = film.kept(folder, episode)
            if kept is not None:
                assert kept.path.read_bytes() == mp4, 'a damaged film is published'
                assert kept.physics.tobytes() == taken.physics.tobytes()
                assert len(kept.thumbnails) == len(taken.thumbnails)
            tally.add(was_refused=kept is None)


ALL = {
    'kills of a run, and going on': kills,
    'damaged files of an unfinished run': damaged_stores,
    'damaged files of a film': damaged_films,
}
