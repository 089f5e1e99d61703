"""The contact sheet: a row of pictures for each episode, time from left to right."""

import dataclasses
import pathlib
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import style

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
        thumbnails: Pictures of equal size at `shown_steps`; the last one shows the end.
    """

    index: int
    episode: Episode
    thumbnails: Sequence[Image.Image]


def shown_steps(max_steps: int, steps: int | None = None) -> list[int]:
    """Returns the control steps of an episode that a contact sheet shows.

    Args:
        max_steps: Control steps of an episode that does not end before.
        steps: Those of the episode, which is shown to its end; None for as many.
    """
    steps = max_steps if steps is None else steps
    columns = {int(step) for step in np.linspace(0, max_steps, _COLUMNS).round()}
    return sorted({*(step for step in columns if step < steps), steps})


def thumbnail(picture: np.ndarray) -> Image.Image:
    """Returns a picture, (height, width, 3) uint8, reduced for the contact sheet."""
    height, width = picture.shape[:2]
    size = (max(1, round(width * _THUMBNAIL_HEIGHT / height)), _THUMBNAIL_HEIGHT)
    return Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)


def save(
    path: pathlib.Path,
    strips: Sequence[Strip],
    title: str,
    control_timestep: float,
    max_steps: int,
) -> None:
    """Writes a png with a row for each episode.

    Args:
        path: The file.
        strips: Rows of the sheet, `MAX_ROWS` at most.
        title: Its title.
        control_timestep: Seconds from one control step to the next.
        max_steps: Control steps of an episode that does not end before.
    """
    width, height = strips[0].thumbnails[0].size
    top = _TITLE_HEIGHT + _HEADING_HEIGHT
    steps = shown_steps(max_steps)[: max(len(each.thumbnails) for each in strips)]
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
    with files.whole_file(path) as partial:
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
    # Matplotlib brings its own fonts: the same everywhere, whatever is installed. The process that
    # takes films has no need of it.
    import matplotlib

    name = 'DejaVuSans-Bold.ttf' if bold else 'DejaVuSans.ttf'
    return ImageFont.truetype(f'{matplotlib.get_data_path()}/fonts/ttf/{name}', size)
