"""What cameras see, as observables of a task."""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from dm_control import mjcf
from dm_control.composer.observation import observable

from fetch_composer.tasks import camera, checks
from fetch_composer.tasks.goal_scene import GoalScene
from fetch_composer.tasks.starts import Start

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
        supersampling: A pixel is the mean of as many squared: 2 smooths edges.
        goal: Whether to observe, beside each picture, one of the scene with object and gripper at
            the goal.
    """

    cameras: tuple[str, ...] = ('corner',)
    height: int = 84
    width: int = 84
    depth: bool = False
    segmentation: bool = False
    shadows: bool = False
    supersampling: int = 1
    goal: bool = False


def options(pixels: 'Mapping | PixelOptions | None') -> PixelOptions:
    """Returns the options that a mapping names.

    Raises:
        ValueError: if one is unknown or makes no sense; the message says what would.
    """
    if isinstance(pixels, PixelOptions):
        pixels = dataclasses.asdict(pixels)
    if pixels is not None and not isinstance(pixels, Mapping):
        raise ValueError(
            f'pixels must be a mapping of options, such as height; got {checks.shown(pixels)}.'
        )
    pixels = dict(pixels or {})
    valid = [field.name for field in dataclasses.fields(PixelOptions)]
    unknown = [each for each in pixels if each not in valid]
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(checks.shown, unknown))} of pixels; '
            f'valid are {", ".join(valid)}.'
        )
    if isinstance(pixels.get('cameras'), str):
        pixels['cameras'] = (pixels['cameras'],)
    if 'cameras' in pixels:
        pixels['cameras'] = tuple(checks.sequence('cameras of pixels', pixels['cameras']))
        if not pixels['cameras']:
            raise ValueError('cameras of pixels must name at least one camera, such as corner.')
    for name in ('height', 'width', 'supersampling'):
        if name in pixels:
            pixels[name] = checks.integer(f'The {name} of pixels', pixels[name], 1)
    for name in ('depth', 'segmentation', 'shadows', 'goal'):
        if name in pixels:
            pixels[name] = checks.boolean(f'{name} of pixels', pixels[name])
    made = PixelOptions(**pixels)
    camera.check_size(made.height, made.width, made.supersampling)
    return made


class CameraObservable(observable.MJCFCamera):
    """What a camera sees, taken with one `camera.Camera` for as long as its model lasts."""

    def __init__(self, element: mjcf.Element, chosen: PixelOptions, kind: str) -> None:
        """Initializes the observable.

        Args:
            element: The camera.
            chosen: Size and looks.
            kind: 'rgb', 'depth' or 'segmentation'.
        """
        super().__init__(
            element,
            height=chosen.height,
            width=chosen.width,
            depth=kind == 'depth',
            segmentation=kind == 'segmentation',
        )
        self._supersampling = chosen.supersampling
        self._shadows = chosen.shadows

    def _callable(self, physics) -> Callable[[], np.ndarray]:
        kept: list[camera.Camera] = []

        def take() -> np.ndarray:
            if not kept:  # Only now, since most observables are never asked.
                name = self._mjcf_element.full_identifier
                kept.append(
                    camera.Camera(
                        physics, name, self._height, self._width, self._supersampling, self._shadows
                    )
                )
            if self._depth:
                return kept[0].depth()[..., np.newaxis]
            return kept[0].segmentation() if self._segmentation else kept[0].picture()

        return take


class GoalCameraObservable(CameraObservable):
    """What a camera would see of the scene at the goal; drawn once in an episode."""

    def __init__(
        self,
        element: mjcf.Element,
        chosen: PixelOptions,
        kind: str,
        goal_scene: Callable[[], GoalScene],
        start: Callable[[], Start],
    ) -> None:
        """Initializes the observable.

        Args:
            element: The camera.
            chosen: Size and looks.
            kind: 'rgb', 'depth' or 'segmentation'.
            goal_scene: Returns what is drawn; asked with the first picture.
            start: Returns the present episode's start, another object for every episode.
        """
        super().__init__(element, chosen, kind)
        self._goal_scene = goal_scene
        self._start = start

    def _callable(self, physics) -> Callable[[], np.ndarray]:
        del physics  # Unused: its simulation is at no goal.
        take: Callable[[], np.ndarray] | None = None
        shown: Start | None = None
        picture: np.ndarray

        def keep() -> np.ndarray:
            nonlocal take, shown, picture
            start, scene = self._start(), self._goal_scene()
            if take is None:
                take = super(GoalCameraObservable, self)._callable(scene.physics)
            if shown is not start:
                scene.show(start)
                shown, picture = start, take()
            return picture

        return keep


def observables(
    mjcf_model: mjcf.RootElement,
    chosen: PixelOptions,
    goal_scene: Callable[[], GoalScene],
    start: Callable[[], Start],
) -> dict[str, CameraObservable]:
    """Returns the enabled observables `<camera>_rgb`, `<camera>_depth`, `<camera>_segmentation`.

    Their arrays are (height, width, 3) uint8, (height, width, 1) float32 in m, and
    (height, width, 2) int32: object id and object type. With the option `goal` there are
    `<camera>_goal_rgb` and so on as well.

    Args:
        mjcf_model: The model.
        chosen: Which pictures.
        goal_scene: Returns the scene at the goal; not asked before the model is compiled.
        start: Returns the present episode's start.

    Raises:
        ValueError: if a camera is not in the model; the message lists those that are.
    """
    factor = chosen.supersampling
    camera.fit_framebuffer(
        getattr(mjcf_model.visual, 'global'), factor * chosen.height, factor * chosen.width
    )
    elements = {each.full_identifier: each for each in mjcf_model.find_all('camera')}
    kinds = ['rgb']
    kinds += ['depth'] * chosen.depth + ['segmentation'] * chosen.segmentation
    made: dict[str, CameraObservable] = {}
    for name in chosen.cameras:
        checks.one_of('camera', name, elements)
        for kind in kinds:
            made[f'{name}_{kind}'] = CameraObservable(elements[name], chosen, kind)
            if chosen.goal:
                made[f'{name}_goal_{kind}'] = GoalCameraObservable(
                    elements[name], chosen, kind, goal_scene, start
                )
    for each in made.values():
        each.enabled = True
    return made
