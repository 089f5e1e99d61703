"""What cameras see, as observables of a task."""

import dataclasses
from collections.abc import Mapping

from dm_control import mjcf
from dm_control.composer.observation import observable

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


def check_observation_mode(mode: str) -> None:
    """Raises `ValueError`, which lists the valid modes, if `mode` is none of them."""
    if mode not in OBSERVATION_MODES:
        raise ValueError(
            f'Unknown observation_mode {mode!r}; valid are {", ".join(OBSERVATION_MODES)}.'
        )


def options(pixels: Mapping | None) -> PixelOptions:
    """Returns the options that a mapping names.

    Raises:
        ValueError: if one is unknown or makes no sense; the message says what would.
    """
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
    chosen = PixelOptions(**pixels)
    for name in ('height', 'width'):
        size = getattr(chosen, name)
        if not isinstance(size, int) or size < 1:
            raise ValueError(f'The {name} of pixels must be a positive integer, got {size!r}.')
    return chosen


def observables(
    mjcf_model: mjcf.RootElement, chosen: PixelOptions
) -> dict[str, observable.MJCFCamera]:
    """Returns the enabled observables `<camera>_rgb`, `<camera>_depth`, `<camera>_segmentation`.

    Their arrays are (height, width, 3) uint8, (height, width, 1) float32 in m, and
    (height, width, 2) int32: object id and object type.

    Raises:
        ValueError: if a camera is not in the model; the message lists those that are.
    """
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
