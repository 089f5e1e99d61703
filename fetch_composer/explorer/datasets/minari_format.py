"""Episodes as a Minari dataset, with the environment that replays them."""

import contextlib
import json
import os
import pathlib
import warnings
from collections.abc import Iterator

import numpy as np

try:
    import gymnasium
    import h5py  # noqa: F401
    import minari
    import PIL  # noqa: F401
    from minari import namespace as namespaces
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_dataset import parse_dataset_id
    from minari.storage import get_dataset_path
except ImportError as error:
    raise ImportError(
        f"--dataset needs {error.name}: pip install 'fetch_composer[minari]'."
    ) from error

from fetch_composer import gymnasium_ids, tasks
from fetch_composer.explorer import files
from fetch_composer.explorer.datasets import part
from fetch_composer.explorer.datasets.contents import Contents, Recorded

_FOLDER_VARIABLE = 'MINARI_DATASETS_PATH'
_GIVEN = ('object_shape', 'object_size', 'object_mesh', 'object_position', 'goal')
_REQUIREMENTS = ('fetch_composer', 'mujoco')
_ABOUT = 'fetch_composer'  # The key of the metadata under which `Contents.about` is, as JSON.


class Dataset:
    """A dataset in Minari's folder.

    Attributes:
        reading: Code that reads it.
        needs_pictures: Whether episodes need pictures.
    """

    needs_pictures = False

    def __init__(self, name: str) -> None:
        """Takes the dataset's name as Minari has it: [namespace/]name-v0.

        Raises:
            ValueError: if it is no name of one.
        """
        try:
            self._namespace, _, _ = parse_dataset_id(name)
        except (TypeError, ValueError):
            raise ValueError(
                f'dataset must have the form [namespace/]name-v0, of letters, digits, - and _, '
                f'got {name!r}.'
            ) from None
        self._name = name
        self.reading = f'minari.load_dataset({name!r})'

    @property
    def path(self) -> pathlib.Path:
        """Its folder."""
        return get_dataset_path(self._name)

    def check(self, seeds: range) -> None:
        """Raises `ValueError` if it cannot hold the episodes of these seeds."""
        del seeds  # Unused: it can.

    def prepare(self) -> None:
        """Makes sure that a dataset can be written.

        Raises:
            OSError: if none can.
        """
        try:
            files.prepare_folder(get_dataset_path())
        except OSError as error:
            raise OSError(f'{error}. {_FOLDER_VARIABLE} says where datasets are') from None

    def found(self) -> list[dict | None]:
        """Returns what is said of the dataset; None if it is not there."""
        return [_about(self.path) if self.path.exists() else None]

    def save(self, contents: Contents) -> None:
        """Writes the dataset, whole or not at all.

        Raises:
            OSError: if it cannot be written.
        """
        options, name = contents.options, self._name
        task_options = options.task_options
        env_id = gymnasium_ids.env_id(
            options.task, task_options.convention, task_options.reward_type
        )
        given = {name: getattr(task_options, name) for name in _GIVEN}
        versions = contents.about['versions']
        folder = self.path
        metadata: list[dict] = []

        def buffers() -> Iterator[EpisodeBuffer]:  # One at a time, since physics is large.
            for index, each in enumerate(contents.recorded()):
                metadata.append(each.metadata)
                yield _buffer(index, each, task_options)

        with (
            part.folder(get_dataset_path(), contents.owner) as partial,
            _datasets_in(partial),  # By an environment variable: Minari takes no other folder.
            warnings.catch_warnings(),
        ):
            # Gymnasium takes -v2 for an old -v4; Minari is not told of an author.
            warnings.simplefilter('ignore')
            with contextlib.closing(
                gymnasium.make(
                    env_id,
                    max_episode_steps=task_options.max_episode_steps,
                    terminate_on_success=task_options.terminate_on_success,
                    action_mode=task_options.action_mode,
                    **{name: place for name, place in given.items() if place is not None},
                )
            ) as environment:
                dataset = minari.create_dataset_from_buffers(
                    name,
                    buffers(),  # type: ignore[arg-type]
                    env=environment,
                    algorithm_name=options.policy,
                    description=f'{options.policy} on {env_id}, by explore.py.',
                    requirements=[
                        f'{each}=={versions[each]}' for each in _REQUIREMENTS if versions[each]
                    ],
                )
            dataset.storage.update_episode_metadata(metadata)
            dataset.storage.update_metadata({_ABOUT: json.dumps(contents.about)})
            folder.parent.mkdir(parents=True, exist_ok=True)
            get_dataset_path(name).rename(folder)

    def finish(self) -> None:
        """Does what is left to do once a dataset is there, and may be done again."""
        if self._namespace is None:
            return
        if self._namespace not in namespaces.list_local_namespaces():
            namespaces.create_namespace(self._namespace)


@contextlib.contextmanager
def _datasets_in(folder: pathlib.Path) -> Iterator[None]:
    before = os.environ.get(_FOLDER_VARIABLE)
    os.environ[_FOLDER_VARIABLE] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[_FOLDER_VARIABLE]
        else:
            os.environ[_FOLDER_VARIABLE] = before


def _about(folder: pathlib.Path) -> dict:
    try:
        return dict(json.loads(files.load_json(folder / 'data' / 'metadata.json')[_ABOUT]))
    except (KeyError, TypeError, ValueError):  # It is another program's.
        return {}


def _buffer(index: int, recorded: Recorded, options: tasks.TaskOptions) -> EpisodeBuffer:
    episode = recorded.episode
    before_last = [False] * (episode.steps - 1)
    return EpisodeBuffer(
        id=index,
        seed=episode.seed,
        observations={
            name: getattr(episode, name)
            for name in ('observation', 'achieved_goal', 'desired_goal')
        },
        actions=episode.action,
        rewards=list(episode.reward),
        terminations=[*before_last, options.terminate_on_success and episode.is_success],
        truncations=[*before_last, episode.steps == options.max_episode_steps],
        infos={
            'is_success': recorded.is_success.astype(np.float32),
            'sparse_reward': recorded.reward('sparse'),
            'dense_reward': recorded.reward('dense'),
            'physics': recorded.physics,
            'gripper_pose': recorded.gripper_pose,
        },
    )
