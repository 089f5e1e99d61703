"""Makes the gallery of docs/tasks.md: an animation of each task's expert, docs/gallery_<task>.gif.

`python docs/make_gallery.py [task ...]`; `make gallery` makes all.
"""

import os
import pathlib
import sys

os.environ.setdefault('MUJOCO_GL', 'egl')

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer.explorer import files  # noqa: E402
from fetch_composer.explorer.episodes import batch_rollout, replay  # noqa: E402
from fetch_composer.tasks import camera  # noqa: E402

_FOLDER = pathlib.Path(__file__).parent
# Episodes that start apart from their goals, and whose targets the camera sees.
_SEEDS = {
    'push': (0, 28),
    'reach': (4, 25),
    'slide': (39, 7),
    'pick_and_place': (21, 39),
    'stack': (0, 3),
    'push_two': (0, 1),
    'push_around': (0, 1),
}
_CAMERA = 'corner'
_SIZE = (400, 300)  # pixels
_OVERSAMPLING = 2
_EVERY = 2  # control steps
_FRAME_MS = 80  # Real time: two control steps of 40 ms.
_HOLD_MS = 700  # The last picture of an episode.
_COLOURS = 96
_LARGEST = 1_000_000  # bytes


def _frames(task: str) -> tuple[list[Image.Image], list[int]]:
    """Returns pictures of the task's episodes and how long each is shown, in ms."""
    env = fetch_composer.load(task)
    env.task.visualize_reward = True
    width, height = (_OVERSAMPLING * each for each in _SIZE)
    corner = camera.Camera(env.physics, _CAMERA, height, width)
    pictures: list[Image.Image] = []
    durations: list[int] = []

    def take(step: int) -> None:
        if step % _EVERY == 0:
            picture = Image.fromarray(corner.picture())
            pictures.append(picture.resize(_SIZE, Image.Resampling.LANCZOS))
            durations.append(_FRAME_MS)

    options = batch_rollout.EpisodeOptions(task, 'expert')
    for episode in batch_rollout.run_episodes(options, _SEEDS[task]):
        if not episode.is_success:
            raise RuntimeError(
                f'{task}: the expert fails with seed {episode.seed}; choose another.'
            )
        replay.replay(env, episode, take)
        durations[-1] = _HOLD_MS
    env.close()
    return pictures, durations


def _save(path: pathlib.Path, pictures: list[Image.Image], durations: list[int]) -> None:
    """Writes an animated GIF whose pictures share their colours, so that nothing flickers."""
    sample = Image.fromarray(np.concatenate([np.asarray(each) for each in pictures[::4]]))
    palette = sample.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT, kmeans=2)
    first, *others = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    with files.whole_file(path) as partial:
        first.save(
            partial, save_all=True, append_images=others, duration=durations, loop=0, optimize=True
        )
    if path.stat().st_size > _LARGEST:
        raise RuntimeError(f'{path.name} has more than {_LARGEST} bytes.')


def main() -> None:
    """Makes the animations of all tasks, or of those that are named."""
    for task in sys.argv[1:] or _SEEDS:
        path = _FOLDER / f'gallery_{task}.gif'
        _save(path, *_frames(task))
        print(f'{path.relative_to(_FOLDER.parent)}: {path.stat().st_size // 1000} kB')


if __name__ == '__main__':
    main()
