"""Frames of an episode, its film, and a contact sheet of many episodes."""

import contextlib
import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Sequence

import imageio.v2 as imageio
import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fetch_composer.explorer.episodes import episode as rollout
from fetch_composer.explorer.pictures import style
from fetch_composer.explorer.results import recording

# A film's pixels are coded in blocks of two by two.
_WIDTHS = (64, 3840)
_HEIGHTS = (64, 2160)
_FPS = (1, 120)
_QUALITY = 8  # Of 10.


def check_film_format(width: int, height: int, fps: int) -> None:
    """Raises `ValueError`, which says what is valid, if no film has such a format.

    Args:
        width: Width in pixels.
        height: Height in pixels.
        fps: Frames per second.
    """
    for name, value, (least, most) in (('width', width, _WIDTHS), ('height', height, _HEIGHTS)):
        if not least <= value <= most or value % 2:
            raise ValueError(
                f'{name} must be an even number of pixels from {least} to {most}, got {value}.'
            )
    if not _FPS[0] <= fps <= _FPS[1]:
        raise ValueError(f'fps must be from {_FPS[0]} to {_FPS[1]} frames per second, got {fps}.')


class Camera:
    """Takes pictures of an environment."""

    def __init__(self, env, name: str, width: int, height: int) -> None:
        """Initializes the camera.

        Args:
            env: A Composer environment.
            name: Name of a camera in its model.
            width: Width of a picture in pixels.
            height: Height of a picture in pixels.

        Raises:
            ValueError: if there is no such camera; the message lists those that there are.
        """
        model = env.physics.model
        names = [model.camera(index).name for index in range(model.ncam)]
        if name not in names:
            raise ValueError(f'Unknown camera {name!r}; valid are {", ".join(names)}.')
        self._env = env
        self._name = name
        self._width = width
        self._height = height

    def picture(self) -> np.ndarray:
        """Returns (height, width, 3) uint8."""
        # The model's buffer is as large as the largest picture must be; it is allocated with
        # the first one, and anew whenever an environment is compiled again.
        buffer = self._env.physics.model.vis.global_
        buffer.offwidth = max(buffer.offwidth, self._width)
        buffer.offheight = max(buffer.offheight, self._height)
        return self._env.physics.render(self._height, self._width, camera_id=self._name)


@contextlib.contextmanager
def film(path: pathlib.Path, fps: int) -> Iterator[Callable[[np.ndarray], None]]:
    """Gives a function that adds a picture, (height, width, 3) uint8, to an mp4 file.

    The file takes its place once all pictures are in; none is left if that does not happen.
    """
    with recording.whole_file(path) as partial:
        writer = imageio.get_writer(
            partial,
            format='FFMPEG',  # type: ignore[arg-type]
            fps=fps,
            codec='libx264',
            quality=_QUALITY,
            pixelformat='yuv420p',
            macro_block_size=2,
            ffmpeg_log_level='error',
        )
        # As a context manager of its own, the writer would leave ffmpeg running on an exception.
        with contextlib.closing(writer):
            yield writer.append_data


# -- The contact sheet: one row per episode, time from left to right ------------------------------

_COLUMNS = 8
_THUMBNAIL_HEIGHT = 170
_GAP = 6
_MARGIN = 24
_LABEL_WIDTH = 150
_TITLE_HEIGHT = 52
_HEADING_HEIGHT = 26
MAX_ROWS = 100  # A taller picture would open in few viewers.


@dataclasses.dataclass(frozen=True)
class Strip:
    """An episode's row of thumbnails.

    Attributes:
        index: Number of the episode in its run, from 0.
        episode: The episode.
        thumbnails: Pictures of equal size, over time.
    """

    index: int
    episode: rollout.Episode
    thumbnails: Sequence[Image.Image]


def shown_steps(steps: int) -> list[int]:
    """Returns the control steps, from 0 to `steps`, that a contact sheet shows."""
    return sorted({int(step) for step in np.linspace(0, steps, _COLUMNS).round()})


def thumbnail(picture: np.ndarray) -> Image.Image:
    """Returns a picture, (height, width, 3) uint8, reduced for the contact sheet."""
    height, width = picture.shape[:2]
    size = (max(1, round(width * _THUMBNAIL_HEIGHT / height)), _THUMBNAIL_HEIGHT)
    return Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)


def save_contact_sheet(
    path: pathlib.Path, strips: Sequence[Strip], title: str, control_timestep: float
) -> None:
    """Writes a png with a row for each episode.

    Args:
        path: The file.
        strips: Rows of the sheet, `MAX_ROWS` at most, of episodes of equal length.
        title: Its title.
        control_timestep: Seconds from one control step to the next.
    """
    width, height = strips[0].thumbnails[0].size
    top = _TITLE_HEIGHT + _HEADING_HEIGHT
    steps = shown_steps(strips[0].episode.steps)
    sheet = Image.new(
        'RGB',
        (
            max(_LABEL_WIDTH + len(steps) * (width + _GAP) + _MARGIN, 720),
            top + len(strips) * (height + _GAP) + _MARGIN,
        ),
        style.PAPER,
    )
    draw = ImageDraw.Draw(sheet)
    draw.text((_MARGIN, 16), title, style.INK, _font(20, bold=True))
    for column, step in enumerate(steps):
        x = _LABEL_WIDTH + column * (width + _GAP)
        draw.text((x, _TITLE_HEIGHT), f'{step * control_timestep:.2f} s', style.FAINT, _font(15))
    for row, strip in enumerate(strips):
        y = top + row * (height + _GAP)
        _draw_label(draw, y, strip)
        for column, image in enumerate(strip.thumbnails):
            sheet.paste(image, (_LABEL_WIDTH + column * (width + _GAP), y))
    with recording.whole_file(path) as partial:
        sheet.save(partial)


def _draw_label(draw: ImageDraw.ImageDraw, y: int, strip: Strip) -> None:
    episode = strip.episode
    colour = style.SUCCESS if episode.is_success else style.FAILURE
    draw.rectangle((0, y, 6, y + _THUMBNAIL_HEIGHT - 1), colour)
    draw.text((_MARGIN, y + 8), f'episode {strip.index}', style.INK, _font(17, bold=True))
    lines = (
        (f'seed {episode.seed}', style.FAINT),
        ('at the goal' if episode.is_success else 'not at the goal', colour),
        (f'{100 * episode.distance[-1]:.1f} cm away', style.FAINT),
        (f'return {episode.total_reward:.4g}', style.FAINT),
    )
    for index, (line, ink) in enumerate(lines):
        draw.text((_MARGIN, y + 38 + 24 * index), line, ink, _font(15))


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    # Matplotlib brings its own fonts: the same everywhere, whatever is installed.
    name = 'DejaVuSans-Bold.ttf' if bold else 'DejaVuSans.ttf'
    return ImageFont.truetype(f'{matplotlib.get_data_path()}/fonts/ttf/{name}', size)
