"""What cameras see, as observables of a task."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable

from fetch_composer.tasks import checks

OBSERVATION_MODES = ('features', 'pixels', 'features+pixels')


@dataclasses.dataclass(frozen=True)
class PixelOptions:
    """Which pictures are observed.

    Attributes:
        cameras: Names of cameras, such as 'corner' or 'fetch/head_camera'.
        height: Height in pixels.
        width: Width in pixels.
        depth: Whether to observe distances, in m, beside colours.
        segmentation: Whether to observe which geom each pixel shows.
        shadows: Whether things cast shadows; without a GPU they take most of the time.
    """

    cameras: tuple[str, ...] = ('corner',)
    height: int = 84
    width: int = 84
    depth: bool = False
    segmentation: bool = False
    shadows: bool = False


def options(pixels: 'Mapping | PixelOptions | None') -> PixelOptions:
    """Returns the options that a mapping names.

    Raises:
        ValueError: if one is unknown or makes no sense; the message says what would.
    """
    if isinstance(pixels, PixelOptions):
        return pixels
    if pixels is not None and not isinstance(pixels, Mapping):
        raise ValueError(f'pixels must be a mapping of options, such as height; got {pixels!r}.')
    pixels = dict(pixels or {})
    valid = [field.name for field in dataclasses.fields(PixelOptions)]
    unknown = sorted(set(pixels) - set(valid))
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(repr, unknown))} of pixels; '
            f'valid are {", ".join(valid)}.'
        )
    if isinstance(pixels.get('cameras'), str):
        pixels['cameras'] = (pixels['cameras'],)
    if 'cameras' in pixels:
        pixels['cameras'] = tuple(pixels['cameras'])
    for name in ('height', 'width'):
        if name in pixels:
            pixels[name] = checks.positive_integer(f'The {name} of pixels', pixels[name])
    for name in ('depth', 'segmentation', 'shadows'):
        if name in pixels and not isinstance(pixels[name], (bool, np.bool_)):
            raise ValueError(f'{name} of pixels must be True or False; got {pixels[name]!r}.')
    return PixelOptions(**pixels)


def fit_framebuffer(model: Any, width: int, height: int) -> None:
    """Makes sure that pictures of that size can be drawn.

    MuJoCo draws into a buffer that is allocated with the first picture.

    Args:
        model: Anything with MuJoCo's `vis.global_` or, of MJCF, `visual`.
        width: Width in pixels.
        height: Height in pixels.
    """
    is_mjcf = hasattr(model, 'visual')
    buffer = getattr(model.visual, 'global') if is_mjcf else model.vis.global_
    buffer.offwidth = max(buffer.offwidth, width)
    buffer.offheight = max(buffer.offheight, height)


def observables(
    mjcf_model: mjcf.RootElement, chosen: PixelOptions
) -> dict[str, observable.MJCFCamera]:
    """Returns the enabled observables `<camera>_rgb`, `<camera>_depth`, `<camera>_segmentation`.

    Their arrays are (height, width, 3) uint8, (height, width, 1) float32 in m, and
    (height, width, 2) int32: object id and object type.

    Raises:
        ValueError: if a camera is not in the model; the message lists those that are.
    """
    fit_framebuffer(mjcf_model, chosen.width, chosen.height)
    elements = {camera.full_identifier: camera for camera in mjcf_model.find_all('camera')}
    made = {}
    for name in chosen.cameras:
        if name not in elements:
            raise ValueError(f'Unknown camera {name!r}; valid are {", ".join(elements)}.')
        kinds: dict[str, dict] = {'rgb': {'render_flag_overrides': {'shadow': chosen.shadows}}}
        if chosen.depth:
            kinds['depth'] = {'depth': True}
        if chosen.segmentation:
            kinds['segmentation'] = {'segmentation': True}
        for kind, arguments in kinds.items():
            made[f'{name}_{kind}'] = observable.MJCFCamera(
                elements[name],
                height=chosen.height,
                width=chosen.width,
                **arguments,
            )
    for each in made.values():
        each.enabled = True
    return made
