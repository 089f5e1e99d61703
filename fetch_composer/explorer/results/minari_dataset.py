"""Episodes as a Minari dataset, with the environment that replays them."""

import contextlib
import hashlib
import os
import pathlib
import shutil
import warnings
from collections.abc import Iterator, Sequence

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
from fetch_composer.explorer.episodes import batch_rollout, provenance
from fetch_composer.explorer.episodes.episode import Episode

_FOLDER_VARIABLE = 'MINARI_DATASETS_PATH'
_GIVEN = ('object_position', 'goal')
_HERE = pathlib.Path()
_REQUIREMENTS = ('fetch_composer', 'mujoco')


def check_name(name: str) -> None:
    """Makes sure that a dataset can be made.

    Args:
        name: Its name, as Minari has it: [namespace/]name-v0.

    Raises:
        ValueError: if the name is not one, if there is a dataset of that name, or if none can be
            written; the message says what to do.
    """
    try:
        parse_dataset_id(name)
    except (TypeError, ValueError):
        raise ValueError(
            f'dataset must have the form [namespace/]name-v0, of letters, digits, - and _, got '
            f'{name!r}.'
        ) from None
    try:
        path = get_dataset_path(name)
        files.prepare_folder(get_dataset_path())
    except OSError as error:
        raise ValueError(
            f'No dataset can be written: {error}. {_FOLDER_VARIABLE} says where to.'
        ) from None
    if path.exists():
        raise ValueError(
            f'There is a dataset {name} already, in {path}: choose another name or version, or '
            f'remove it with `minari delete {name}`.'
        )


def save(
    name: str,
    options: batch_rollout.EpisodeOptions,
    episodes: Sequence[Episode],
    owner: pathlib.Path = _HERE,
) -> pathlib.Path:
    """Writes episodes as a dataset, whole or not at all, and returns its folder.

    Args:
        name: Its name, for which `check_name` has passed.
        options: What the episodes were run with.
        episodes: The episodes.
        owner: The folder of the run, which no other one writes into at the same time. What an
            earlier one of it has left unfinished is removed.

    Raises:
        ValueError: as `check_name` does.
        OSError: if it cannot be written.
    """
    check_name(name)
    task_options = options.task_options
    env_id = gymnasium_ids.env_id(options.task, task_options.convention, task_options.reward_type)
    given = {name: getattr(task_options, name) for name in _GIVEN}
    versions = provenance.versions()
    folder = get_dataset_path(name)
    with (
        _partial_folder(owner) as partial,
        _datasets_in(partial),  # By an environment variable, in which Minari looks for its own.
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
            minari.create_dataset_from_buffers(
                name,
                [_buffer(index, each, task_options) for index, each in enumerate(episodes)],
                env=environment,
                algorithm_name=options.policy,
                description=f'{options.policy} on {env_id}, by explore.py.',
                requirements=[
                    f'{each}=={versions[each]}' for each in _REQUIREMENTS if versions[each]
                ],
            )
        folder.parent.mkdir(parents=True, exist_ok=True)
        get_dataset_path(name).rename(folder)
    namespace = parse_dataset_id(name)[0]
    if namespace is not None and namespace not in namespaces.list_local_namespaces():
        namespaces.create_namespace(namespace)
    return folder


@contextlib.contextmanager
def _partial_folder(owner: pathlib.Path) -> Iterator[str]:
    """Gives a hidden folder beside the datasets, of which Minari takes no notice."""
    name = hashlib.sha256(str(owner.resolve()).encode()).hexdigest()[:16]
    path = get_dataset_path() / f'.fetch_composer_{name}'
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(mode=0o700)
    try:
        yield str(path)
    finally:
        shutil.rmtree(path, ignore_errors=True)


@contextlib.contextmanager
def _datasets_in(folder: str) -> Iterator[None]:
    before = os.environ.get(_FOLDER_VARIABLE)
    os.environ[_FOLDER_VARIABLE] = folder
    try:
        yield
    finally:
        if before is None:
            del os.environ[_FOLDER_VARIABLE]
        else:
            os.environ[_FOLDER_VARIABLE] = before


def _buffer(index: int, episode: Episode, options: tasks.TaskOptions) -> EpisodeBuffer:
    before_last = [False] * (episode.steps - 1)
    goals = (episode.achieved_goal, episode.desired_goal)
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
        infos={'is_success': tasks.is_success(*goals).astype(np.float32)},
    )
