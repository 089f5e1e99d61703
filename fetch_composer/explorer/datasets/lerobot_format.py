"""Episodes as a LeRobotDataset, with pictures as video.

Each episode of T control steps has T frames: what was seen, the action that followed, and what came
of it. What policies are to learn from is float32, as in other datasets of LeRobot; what leads back
into the environment is float64.
"""

import os
import pathlib
from typing import Any

import numpy as np

try:
    from datasets import disable_progress_bars
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError as error:
    raise ImportError(
        f"--dataset=lerobot:DIR needs {error.name}: pip install 'fetch_composer[lerobot]'."
    ) from error

from fetch_composer.explorer import files
from fetch_composer.explorer.datasets import part
from fetch_composer.explorer.datasets.contents import Contents, Recorded
from fetch_composer.tasks import goal_task, layout, registry

_ROBOT = 'fetch'
_FPS = round(1 / goal_task.CONTROL_TIMESTEP)
_ABOUT = pathlib.Path('meta', 'fetch_composer.json')
_PICTURE = 'observation.images.camera'
_LARGEST_SEED = 2**63 - 1

_Frame = dict[str, Any]


class Dataset:
    """A folder that `LeRobotDataset` reads.

    Attributes:
        path: The folder.
        reading: Code that reads it.
        needs_pictures: Whether episodes need pictures.
    """

    needs_pictures = True

    def __init__(self, path: str) -> None:
        """Takes the folder.

        Raises:
            ValueError: if it has no name.
        """
        self.path = pathlib.Path(path)
        if not path or not self.path.name:
            raise ValueError(f'dataset must have the form lerobot:DIR; got {path!r}.')
        self._id = f'fetch_composer/{self.path.name}'
        self.reading = f'LeRobotDataset({self._id!r}, root={path!r})'

    def check(self, seeds: range) -> None:
        """Raises `ValueError` if it cannot hold the episodes of these seeds."""
        if seeds[-1] > _LARGEST_SEED:
            raise ValueError(
                f'seed must be at most {_LARGEST_SEED} in a dataset of LeRobot; got {seeds[-1]}.'
            )

    def prepare(self) -> None:
        """Makes sure that a dataset can be written.

        Raises:
            OSError: if none can.
        """
        files.prepare_folder(self.path.parent)

    def found(self) -> list[dict | None]:
        """Returns what is said of the dataset; None if it is not there."""
        return [files.load_json(self.path / _ABOUT) if self.path.exists() else None]

    def save(self, contents: Contents) -> None:
        """Writes the dataset, whole or not at all.

        Raises:
            OSError: if it cannot be written.
        """
        assert contents.pictures is not None
        instruction = registry.task_class(contents.options.task).instruction
        dataset = None
        os.environ.setdefault('SVT_LOG', '1')  # Else the encoder tells of each episode.
        disable_progress_bars()
        with part.folder(self.path.parent, contents.owner) as folder:
            root = folder / self.path.name
            for recorded in contents.recorded():
                pictures = list(contents.pictures(recorded.episode))
                frames = _frames(recorded)
                if dataset is None:
                    dataset = LeRobotDataset.create(
                        self._id,
                        fps=_FPS,
                        features=_features(frames[0], pictures[0]),
                        root=root,
                        robot_type=_ROBOT,
                    )
                for frame, picture in zip(frames, pictures, strict=False):  # Not the last one.
                    dataset.add_frame({**frame, _PICTURE: picture, 'task': instruction})
                dataset.save_episode()
            assert dataset is not None
            dataset.finalize()
            files.save_json(root / _ABOUT, contents.about)
            root.rename(self.path)

    def finish(self) -> None:
        """Does nothing: there is nothing left to do."""


def _features(frame: _Frame, picture: np.ndarray) -> dict[str, dict]:
    features = {
        name: {'dtype': 'string', 'shape': (1,), 'names': None}
        if isinstance(value, str)
        else {'dtype': value.dtype.name, 'shape': value.shape, 'names': None}
        for name, value in frame.items()
    }
    names = ['height', 'width', 'channels']
    return {**features, _PICTURE: {'dtype': 'video', 'shape': picture.shape, 'names': names}}


def _frames(recorded: Recorded) -> list[_Frame]:
    """Returns what there is of each control step but the picture."""
    episode = recorded.episode
    has_one = episode.observation.shape[1] == layout.WITH_OBJECT.size
    at = layout.WITH_OBJECT if has_one else layout.WITHOUT_OBJECT  # Of several, the gripper's.
    of_robot = (at.grip_position, at.fingers, at.grip_velocity, at.finger_velocities)
    columns = {
        'observation.state': np.concatenate(
            [episode.observation[:, each] for each in of_robot], axis=1
        ).astype(np.float32),
        'observation.environment_state': np.concatenate(
            [episode.observation, episode.desired_goal], axis=1
        ).astype(np.float32),
        'action': episode.action.astype(np.float32),
        'next.reward': episode.reward.astype(np.float32),
        'next.success': recorded.is_success[1:],
        'next.done': np.arange(1, episode.steps + 1) == episode.steps,
        'next.sparse_reward': recorded.reward('sparse')[1:],
        'next.dense_reward': recorded.reward('dense')[1:],
        'seed': np.full(episode.steps, episode.seed, np.int64),
        'start': np.tile(recorded.start, (episode.steps, 1)),
        'goal': episode.desired_goal,
        'exact_observation': episode.observation,
        'physics': recorded.physics,
        'gripper_pose': recorded.gripper_pose,
    }
    return [
        {
            'policy': recorded.policy,
            **{name: np.atleast_1d(values[step]) for name, values in columns.items()},
        }
        for step in range(episode.steps)
    ]
