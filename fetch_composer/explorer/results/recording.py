"""Files that are written whole or not at all, and the data that goes into them."""

import contextlib
import importlib.metadata
import json
import os
import pathlib
import platform
import shutil
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer.explorer.episodes import episode as rollout
from fetch_composer.explorer.results import statistics

_DISTRIBUTIONS = ('fetch_composer', 'dm-control', 'mujoco', 'numpy')


@contextlib.contextmanager
def whole_file(path: pathlib.Path) -> Iterator[pathlib.Path]:
    """Gives a path to write to, which takes the place of `path` once all is written.

    If writing fails or is interrupted, `path` stays what it was.
    """
    partial = path.with_name(f'.{path.stem}.{os.getpid()}.part{path.suffix}')
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def prepare_folder(folder: pathlib.Path) -> None:
    """Makes a folder, unless it is there, and makes sure that files can be written into it.

    Raises:
        OSError: if they cannot.
    """
    folder.mkdir(parents=True, exist_ok=True)
    probe = folder / f'.{os.getpid()}.part'
    try:
        probe.touch()
    finally:
        probe.unlink(missing_ok=True)


def save_trajectories(path: pathlib.Path, episodes: Sequence[rollout.Episode]) -> None:
    """Writes the arrays of `rollout.stack` to an npz file."""
    with whole_file(path) as partial:
        np.savez_compressed(partial, allow_pickle=False, **rollout.stack(episodes))


def save_arrays(path: pathlib.Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Writes arrays to an npz file; uncompressed, since it is soon read again."""
    with whole_file(path) as partial:
        np.savez(partial, allow_pickle=False, **arrays)


def copy(source: pathlib.Path, path: pathlib.Path) -> None:
    """Copies a file."""
    with whole_file(path) as partial:
        shutil.copyfile(source, partial)


def save_json(path: pathlib.Path, content: Mapping[str, Any]) -> None:
    """Writes an indented JSON file."""
    save_text(path, json.dumps(content, indent=2) + '\n')


def save_text(path: pathlib.Path, text: str) -> None:
    """Writes a text file."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding='utf-8')


def load_json(path: pathlib.Path) -> dict[str, Any]:
    """Returns what is in a JSON file; nothing if there is none that can be read."""
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def versions() -> dict[str, str | None]:
    """Returns the versions of Python and of the packages that decide on a trajectory."""
    found: dict[str, str | None] = {'python': platform.python_version()}
    for name in _DISTRIBUTIONS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:  # Run from a clone.
            found[name] = None
    return found


def summarize(episodes: Sequence[rollout.Episode]) -> dict[str, Any]:
    """Returns figures of one or more episodes, for `save_json`."""
    distances = [float(each.distance[-1]) for each in episodes]
    returns = [each.total_reward for each in episodes]
    seconds = sum(each.step_seconds for each in episodes)
    success = statistics.success_rate([each.is_success for each in episodes])
    return {
        'success_rate': success.value,
        'success_interval': [success.low, success.high],
        'return': _spread(returns),
        'final_distance_m': _spread(distances),
        'control_steps_per_second': round(sum(each.steps for each in episodes) / seconds, 1),
        'episodes': [
            {
                'seed': each.seed,
                'steps': each.steps,
                'is_success': each.is_success,
                'return': each.total_reward,
                'final_distance_m': distance,
            }
            for each, distance in zip(episodes, distances, strict=True)
        ],
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {
        'mean': float(np.mean(values)),
        'median': float(np.median(values)),
        'min': float(np.min(values)),
        'max': float(np.max(values)),
    }
