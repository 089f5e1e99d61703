"""Films of episodes: which to film, in what format, and the mp4 files, taken during a replay."""

import contextlib
import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import imageio.v2 as imageio
import numpy as np
from PIL import Image

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import replay
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import contact_sheet
from fetch_composer.tasks import checks
from fetch_composer.tasks.camera import Camera

CHOICES = ('worst', 'best', 'first', 'all', 'none')

# A film's colours are coded for two by two pixels at a time.
_WIDTHS = (64, 3840)
_HEIGHTS = (64, 2160)
_FPS = (1, 120)
_QUALITY = 8  # Of 10.
_DIGEST = 'digest_of_film'


def check_choice(choice: str) -> None:
    """Raises `ValueError`, which lists the valid ones, if there is no such choice of films."""
    checks.one_of('films', choice, CHOICES)


def choose(final_distances: Sequence[Sequence[float]], choice: str, count: int) -> list[int]:
    """Returns the indices of the episodes to film, those to look at first at the front.

    Args:
        final_distances: For each policy, the distances to the goal at its episodes' ends, in m.
            An episode is as bad as the policy that does worst in it.
        choice: One of `CHOICES`.
        count: How many to choose at most; 'all' ignores it.
    """
    badness = np.max(final_distances, axis=0)
    if choice == 'none':
        return []
    if choice == 'all':
        return list(range(len(badness)))
    order = {
        'worst': np.argsort(-badness, kind='stable'),
        'best': np.argsort(badness, kind='stable'),
        'first': np.arange(len(badness)),
    }[choice]
    return order[:count].tolist()


def check_format(width: int, height: int, fps: int) -> None:
    """Raises `ValueError`, which says what is valid, if no film has such a format.

    Args:
        width: Width in pixels.
        height: Height in pixels.
        fps: Frames per second.
    """
    for name, value, (least, most) in (('width', width, _WIDTHS), ('height', height, _HEIGHTS)):
        value = checks.integer(name, value, 0)
        if not least <= value <= most or value % 2:
            raise ValueError(
                f'{name} must be an even number of pixels from {least} to {most}, '
                f'got {checks.shown(value)}.'
            )
    fps = checks.integer('fps', fps, 0)
    if not _FPS[0] <= fps <= _FPS[1]:
        raise ValueError(
            f'fps must be from {_FPS[0]} to {_FPS[1]} frames per second, got {checks.shown(fps)}.'
        )


@contextlib.contextmanager
def writer(path: pathlib.Path, fps: int) -> Iterator[Callable[[np.ndarray], None]]:
    """Gives a function that adds a picture, (height, width, 3) uint8, to an mp4 file.

    The file takes its place once all pictures are in; none is left if that does not happen.
    """
    with files.whole_file(path) as partial:
        mp4 = imageio.get_writer(
            partial,
            format='FFMPEG',  # type: ignore[arg-type]
            fps=fps,
            codec='libx264',
            quality=_QUALITY,
            pixelformat='yuv420p',
            macro_block_size=2,
            ffmpeg_log_level='error',
        )
        # As a context manager of its own, imageio's would leave ffmpeg running on an exception.
        with contextlib.closing(mp4):
            yield mp4.append_data


@dataclasses.dataclass(frozen=True)
class Film:
    """A film of an episode.

    Attributes:
        path: The mp4 file.
        thumbnails: Pictures of equal size at `contact_sheet.shown_steps`.
        physics: (T + 1, n) MuJoCo's integration state at every control step.
        gripper_pose: (T + 1, 7) poses from which an action moves the gripper.
    """

    path: pathlib.Path
    thumbnails: Sequence[Image.Image]
    physics: np.ndarray
    gripper_pose: np.ndarray


def kept(folder: pathlib.Path, episode: Episode) -> Film | None:
    """Returns the film of an episode if there is one in a folder, as it was taken."""
    path = _mp4(folder, episode)
    try:
        arrays = files.load_arrays(_thumbnails(folder, episode))
        if files.digest(path) != str(arrays.pop(_DIGEST)):
            return None
        thumbnails = [Image.fromarray(picture) for picture in arrays.pop('thumbnails')]
        return Film(path, thumbnails, **arrays)
    except (files.UnreadableError, OSError, KeyError, TypeError, ValueError):
        return None  # It is taken again.


def take(
    folder: pathlib.Path,
    episode: Episode,
    env: Any,
    camera: Camera,
    fps: int,
    on_progress: Callable[[int], None],
) -> Film:
    """Films an episode while it is replayed.

    Args:
        folder: Where films are kept; made with the first one.
        episode: The episode.
        env: A single environment of the options that the episode was run with.
        camera: What takes the pictures.
        fps: Frames per second.
        on_progress: Called at each step, with the number of steps so far; if it raises, there is
            no film.

    Raises:
        ReplayError: if the episode does not end as it did.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shown = contact_sheet.shown_steps(env.task.options.max_episode_steps, episode.steps)
    thumbnails, states = [], []
    path = _mp4(folder, episode)
    files.remove_folder(path)
    with writer(path, fps) as add_picture:

        def add(step: int) -> None:
            on_progress(step)
            picture = camera.picture()
            add_picture(picture)
            states.append(env.get_state())
            if step in shown:
                thumbnails.append(contact_sheet.thumbnail(picture))

        replay.replay(env, episode, add)
    # Last, so that a film with thumbnails is a whole one.
    arrays = {
        name: np.stack([getattr(each, name) for each in states])
        for name in ('physics', 'gripper_pose')
    }
    pictures = np.stack([np.asarray(each) for each in thumbnails])
    digest = np.array(files.digest(path))
    files.remove_folder(_thumbnails(folder, episode))
    files.save_arrays(
        _thumbnails(folder, episode), {'thumbnails': pictures, _DIGEST: digest, **arrays}
    )
    return Film(path, thumbnails, **arrays)


def _mp4(folder: pathlib.Path, episode: Episode) -> pathlib.Path:
    return folder / f'seed_{episode.seed}.mp4'


def _thumbnails(folder: pathlib.Path, episode: Episode) -> pathlib.Path:
    return folder / f'seed_{episode.seed}.npz'
