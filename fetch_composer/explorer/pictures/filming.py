"""Which episodes to film, and their films, taken while they are replayed."""

import dataclasses
import pathlib
from collections.abc import Callable, Sequence

import numpy as np
from PIL import Image

from fetch_composer.explorer.episodes import episode as rollout
from fetch_composer.explorer.episodes import replay
from fetch_composer.explorer.pictures import rendering
from fetch_composer.explorer.results import recording

CHOICES = ('worst', 'best', 'first', 'all', 'none')


def check_choice(films: str) -> None:
    """Raises `ValueError`, which lists the valid ones, if there is no such choice."""
    if films not in CHOICES:
        raise ValueError(f'Unknown films {films!r}; valid are {", ".join(CHOICES)}.')


def choose(final_distances: Sequence[Sequence[float]], films: str, count: int) -> list[int]:
    """Returns the indices of the episodes to film, those to look at first at the front.

    Args:
        final_distances: For each policy, the distances to the goal at its episodes' ends, in m.
            An episode is as bad as the policy that does worst in it.
        films: One of `CHOICES`.
        count: How many to choose at most; 'all' ignores it.
    """
    badness = np.max(final_distances, axis=0)
    if films == 'none':
        return []
    if films == 'all':
        return list(range(len(badness)))
    order = {
        'worst': np.argsort(-badness, kind='stable'),
        'best': np.argsort(badness, kind='stable'),
        'first': np.arange(len(badness)),
    }[films]
    return order[:count].tolist()


@dataclasses.dataclass(frozen=True)
class Film:
    """A film of an episode.

    Attributes:
        path: The mp4 file.
        thumbnails: Pictures of equal size at `rendering.shown_steps`.
    """

    path: pathlib.Path
    thumbnails: Sequence[Image.Image]


class Studio:
    """Films episodes into a folder; what is there already is not filmed again."""

    def __init__(self, folder: pathlib.Path, env, camera: rendering.Camera, fps: int) -> None:
        """Initializes the studio.

        Args:
            folder: Where films are kept; made when the first one is.
            env: A single environment of the options that the episodes were run with.
            camera: What takes the pictures.
            fps: Frames per second.
        """
        self._folder = folder
        self._env = env
        self._camera = camera
        self._fps = fps

    def kept(self, episode: rollout.Episode) -> Film | None:
        """Returns the film of an episode if there is one."""
        try:
            with np.load(self._thumbnails(episode)) as file:
                pictures = file['thumbnails']
        except OSError:
            return None
        return Film(self._film(episode), [Image.fromarray(picture) for picture in pictures])

    def film(self, episode: rollout.Episode, on_progress: Callable[[int], None]) -> Film:
        """Films an episode while it is replayed.

        Args:
            episode: The episode.
            on_progress: Called at each step, with the number of steps so far; if it raises, there
                is no film.

        Raises:
            ReplayError: if the episode does not end as it did.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        shown, thumbnails = rendering.shown_steps(episode.steps), []
        path = self._film(episode)
        with rendering.film(path, self._fps) as add_picture:

            def take(step: int) -> None:
                on_progress(step)
                picture = self._camera.picture()
                add_picture(picture)
                if step in shown:
                    thumbnails.append(rendering.thumbnail(picture))

            replay.replay(self._env, episode, take)
        # Last, so that a film with thumbnails is a whole one.
        recording.save_arrays(
            self._thumbnails(episode), {'thumbnails': np.stack([np.asarray(t) for t in thumbnails])}
        )
        return Film(path, thumbnails)

    def _film(self, episode: rollout.Episode) -> pathlib.Path:
        return self._folder / f'seed_{episode.seed}.mp4'

    def _thumbnails(self, episode: rollout.Episode) -> pathlib.Path:
        return self._folder / f'seed_{episode.seed}.npz'
