"""Keeps what an unfinished run has done, so that the same command can continue it.

A folder of files, each whole: what was run, the episodes finished so far, and films. It goes when
the run has finished, because then its results are in their places.
"""

import dataclasses
import pathlib
import shutil
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import episode as episode_lib
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.folder_lock import FolderLock

NAME = '.unfinished_run'
_IDENTITY = 'identity.json'
_EPISODES = 'episodes_from_seed_{seed}.npz'


class Store:
    """What an unfinished run has done; of one process at a time."""

    def __init__(self, folder: pathlib.Path, identity: dict[str, Any], fresh: bool = False) -> None:
        """Opens what is there of a run, or begins one.

        Args:
            folder: The folder that the run writes its results into.
            identity: What decides on its episodes, fit for JSON. Episodes of another identity
                are never mixed with this run's.
            fresh: Whether to discard what is there.

        Raises:
            ValueError: if there is an unfinished run of another identity, or one that is still
                at work; the message says what to do. Nothing is changed.
            OSError: if nothing can be written.
        """
        self._path = folder / NAME
        if self._path.is_symlink():
            raise ValueError(f'{self._path} is a link to elsewhere, which a run would clear.')
        self._path.mkdir(exist_ok=True)
        self._lock = FolderLock(self._path, shown=folder)
        self._is_closed = False
        try:
            files.clear_parts(self._path, recursive=True)
            found = files.load_json(self._path / _IDENTITY)
            if fresh or not found or self.is_empty:
                self._clear()
            elif found != identity:
                names = sorted(
                    name for name in {*found, *identity} if found.get(name) != identity.get(name)
                )
                raise ValueError(
                    f'{folder} holds an unfinished run that differs in {", ".join(names)}: '
                    'continue it with its own command, choose another --output_dir, or discard '
                    'it with --fresh.'
                )
            files.remove_folder(self._path / _IDENTITY)
            files.save_json(self._path / _IDENTITY, identity)
        except BaseException:
            self._lock.close()
            raise

    def folder(self, *names: str) -> pathlib.Path:
        """Returns a folder of the store, which need not be there yet."""
        return self._path.joinpath(*names)

    def episodes(self, policy: str, seeds: Sequence[int]) -> list[Episode]:
        """Returns the kept episodes of some seeds, each once, in the order of the seeds."""
        found: dict[int, Episode] = {}
        for path in sorted(self.folder(policy).glob(_EPISODES.format(seed='*'))):
            for episode in _load(path):
                found.setdefault(episode.seed, episode)
        return [found[seed] for seed in seeds if seed in found]

    def add(self, policy: str, episodes: Sequence[Episode]) -> None:
        """Keeps episodes of one policy, named as in `episodes`: all of them or none."""
        self.folder(policy).mkdir(exist_ok=True)
        path = self.folder(policy) / _EPISODES.format(seed=episodes[0].seed)
        files.remove_folder(path)
        seconds = np.array([each.step_seconds for each in episodes])
        files.save_arrays(path, {**episode_lib.stack(episodes), 'step_seconds': seconds})

    @property
    def is_empty(self) -> bool:
        """Whether no episode is kept."""
        return next(self._path.glob(f'*/{_EPISODES.format(seed="*")}'), None) is None

    def close(self) -> None:
        """Lets go of the store, for another process to continue; an empty one is removed."""
        if self._is_closed:
            return
        if self.is_empty:
            self.discard()
        self._is_closed = True
        self._lock.close()

    def discard(self) -> None:
        """Removes the store, since the run has finished."""
        # Without an identity, whatever else is left counts for nothing.
        files.remove_folder(self._path / _IDENTITY)
        (self._path / _IDENTITY).unlink(missing_ok=True)
        shutil.rmtree(self._path, ignore_errors=True)
        self._is_closed = True
        self._lock.close()

    def _clear(self) -> None:
        files.remove_folder(self._path / _IDENTITY)
        (self._path / _IDENTITY).unlink(missing_ok=True)
        for path in self._path.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()


def _load(path: pathlib.Path) -> list[Episode]:
    """Returns the episodes in a file; if it cannot be read, they are run again."""
    try:
        return list(_episodes(files.load_arrays(path)))
    except (IndexError, KeyError, TypeError, ValueError):  # Or arrays of something else.
        return []


def _episodes(arrays: Mapping[str, np.ndarray]) -> Iterator[Episode]:
    names = {field.name for field in dataclasses.fields(Episode)}
    for index, steps in enumerate(arrays['steps']):
        values = {name: arrays[name][index] for name in names}
        for name in names - {'seed', 'step_seconds'}:
            values[name] = values[name][: steps if name in ('action', 'reward') else steps + 1]
        values['seed'] = int(values['seed'])
        values['step_seconds'] = float(values['step_seconds'])
        yield Episode(**values)
