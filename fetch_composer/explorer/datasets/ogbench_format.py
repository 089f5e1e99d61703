"""Episodes as flat arrays in two npz files, as OGBench's loader reads them.

Each episode of T control steps has T + 1 rows, one for each observation. The last one has
`terminals` 1, and an action of zeros that nobody took: the loader makes transitions of neighbouring
rows, and drops what would lead from one episode into the next.
"""

import contextlib
import json
import pathlib
from collections.abc import Mapping

import numpy as np

from fetch_composer import suite
from fetch_composer.explorer import files
from fetch_composer.explorer.datasets import part
from fetch_composer.explorer.datasets.contents import Contents, Recorded
from fetch_composer.explorer.episodes import episode as episode_lib
from fetch_composer.explorer.episodes.batch_rollout import EpisodeOptions

_SUFFIX = '.npz'
_ABOUT = 'about'  # The array that has `Contents.about`, as JSON.
_VALIDATION = 10  # Every so many episodes, one is for validation.


class Dataset:
    """A file to train with, PATH.npz, and one to validate with, PATH-val.npz.

    Attributes:
        path: The file to train with.
        reading: Code that reads it.
        needs_pictures: Whether episodes need pictures.
    """

    needs_pictures = False

    def __init__(self, path: str) -> None:
        """Takes the path of the file to train with.

        Raises:
            ValueError: if it does not end with .npz.
        """
        if not path.endswith(_SUFFIX) or pathlib.Path(path).name == _SUFFIX:
            raise ValueError(f'dataset must have the form ogbench:PATH.npz; got {path!r}.')
        self.path = pathlib.Path(path)
        self._paths = (self.path, self.path.with_name(f'{self.path.stem}-val{_SUFFIX}'))
        self.reading = f'ogbench.utils.load_dataset({path!r})'

    def check(self, seeds: range) -> None:
        """Raises `ValueError` if it cannot hold the episodes of these seeds."""
        if len(seeds) < 2:
            raise ValueError(
                f'episodes must be at least 2, to train and to validate with; got {len(seeds)}.'
            )

    def prepare(self) -> None:
        """Makes sure that a dataset can be written.

        Raises:
            OSError: if none can.
        """
        files.prepare_folder(self.path.parent)

    def found(self) -> list[dict | None]:
        """Returns what is said of each file that is there; None for one that is not."""
        return [_about(path) if path.exists() else None for path in self._paths]

    def save(self, contents: Contents) -> None:
        """Writes both files, each whole or not at all.

        Raises:
            OSError: if they cannot be written.
        """
        nums_rows = np.array([each.steps + 1 for each in contents.episodes])
        index = np.arange(len(nums_rows))
        # At least one episode, and not the only one.
        is_validation = index % _VALIDATION == min(_VALIDATION, len(index)) - 1
        parts = [_Rows(nums_rows[mask].sum()) for mask in (~is_validation, is_validation)]
        sizes = _sizes(contents.options)
        for each, which in zip(contents.recorded(), is_validation.astype(int), strict=True):
            parts[which].add(each, _rows(each, *sizes))
        about = np.array(json.dumps(contents.about))
        with part.folder(self.path.parent, contents.owner) as folder:
            for path, rows in zip(self._paths, parts, strict=True):
                files.save_arrays(
                    folder / path.name, {**rows.arrays(), _ABOUT: about}, compressed=True
                )
            for path in self._paths:
                (folder / path.name).replace(path)

    def finish(self) -> None:
        """Does nothing: there is nothing left to do."""


class _Rows:
    """Arrays that are filled an episode after the other; all physics does not fit twice."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._filled = 0
        self._arrays: dict[str, np.ndarray] = {}
        self._of_episodes: dict[str, list] = {}
        self._seeds: list[int] = []

    def add(self, recorded: Recorded, rows: Mapping[str, np.ndarray]) -> None:
        """Adds the rows of an episode, and what is said once of it."""
        start, self._filled = self._filled, self._filled + recorded.episode.steps + 1
        for name, array in rows.items():
            if name not in self._arrays:
                self._arrays[name] = np.empty((self._count, *array.shape[1:]), array.dtype)
            self._arrays[name][start : self._filled] = array
        self._seeds.append(recorded.episode.seed)
        of_episode = {'steps': recorded.episode.steps, **recorded.metadata}
        for name, value in of_episode.items():
            self._of_episodes.setdefault(f'episode_{name}', []).append(value)

    def arrays(self) -> dict[str, np.ndarray]:
        """Returns all arrays by name."""
        return {
            **self._arrays,
            'episode_seed': episode_lib.seed_array(self._seeds),
            **{name: np.array(values) for name, values in self._of_episodes.items()},
        }


def _rows(recorded: Recorded, num_positions: int, num_velocities: int) -> dict[str, np.ndarray]:
    """Returns a row for each observation of an episode, by name."""
    episode = recorded.episode
    none_taken = np.zeros_like(episode.action[:1])
    _, positions, velocities, _ = np.split(  # The first number is the time.
        recorded.physics, np.cumsum([1, num_positions, num_velocities]), axis=1
    )
    return {
        'observations': episode.observation,
        'actions': np.concatenate([episode.action, none_taken]),
        'terminals': (np.arange(episode.steps + 1) == episode.steps).astype(np.float32),
        'rewards': _of_action(episode.reward, 0),
        'masks': _of_action(1 - recorded.is_success[1:].astype(np.float32), 1),
        'sparse_rewards': _of_action(recorded.reward('sparse')[1:], 0),
        'dense_rewards': _of_action(recorded.reward('dense')[1:], 0),
        'successes': recorded.is_success,
        'achieved_goals': episode.achieved_goal,
        'desired_goals': episode.desired_goal,
        'qpos': positions,
        'qvel': velocities,
        'physics': recorded.physics,
        'gripper_pose': recorded.gripper_pose,
    }


def _of_action(values: np.ndarray, of_none: float) -> np.ndarray:
    """Returns what followed each action, and a number for the last row, whose action is none."""
    return np.append(values, np.array(of_none, values.dtype))


def _sizes(options: EpisodeOptions) -> tuple[int, int]:
    """Returns how many positions and velocities MuJoCo's state has."""
    environment = suite.load(suite.DOMAIN, options.task, options.task_kwargs)
    with contextlib.closing(environment):
        return environment.physics.model.nq, environment.physics.model.nv


def _about(path: pathlib.Path) -> dict:
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(json.loads(str(file[_ABOUT])))
    except Exception:  # Whatever a file may hold that another program has written.
        return {}
