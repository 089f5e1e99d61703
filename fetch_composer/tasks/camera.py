"""Pictures of a simulation."""

from typing import Any

import numpy as np
from dm_control.mujoco import engine

from fetch_composer.tasks import checks

_RGB = 3
_LARGEST = 16384  # Pixels along a side, of which OpenGL draws no more.


def check_size(height: int, width: int, supersampling: int) -> None:
    """Raises `ValueError`, which says how large one may be, if no picture can be so large."""
    largest = _LARGEST // int(supersampling)  # Which may be one of NumPy's, of eight bits.
    if max(height, width) > largest:
        raise ValueError(
            f'height and width must be at most {largest} pixels with a supersampling of '
            f'{checks.shown(supersampling)}; got {checks.shown(height)} and {checks.shown(width)}.'
        )


class Camera:
    """Takes pictures with a camera of the model, and keeps what MuJoCo needs to draw them.

    MuJoCo draws without smoothing edges, which without a GPU takes most of the time. To smooth
    them, draw each pixel several times.
    """

    def __init__(
        self,
        physics: Any,
        name: str,
        height: int,
        width: int,
        supersampling: int = 1,
        shadows: bool = True,
    ) -> None:
        """Initializes the camera.

        Args:
            physics: The physics of a Composer environment, which must be alive.
            name: Name of a camera of its model.
            height: Height of a picture in pixels.
            width: Width of a picture in pixels.
            supersampling: A pixel of a picture is the mean of as many pixels squared.
            shadows: Whether things cast shadows.

        Raises:
            ValueError: if there is no such camera; the message lists those that there are.
        """
        check_name(physics, name)
        self.physics = physics  # Which a new compilation replaces.
        self._name = name
        self._size = height, width
        self._factor = supersampling
        self._flags = {'shadow': shadows}
        self._cameras: dict[int, engine.Camera] = {}

    def _camera(self, factor: int) -> engine.Camera:
        """Returns a camera that draws so many pixels along each side of a picture's."""
        if factor not in self._cameras:
            height, width = (factor * each for each in self._size)
            fit_framebuffer(self.physics.model.vis.global_, height, width)
            self._cameras[factor] = engine.Camera(self.physics, height, width, camera_id=self._name)
        return self._cameras[factor]

    def picture(self) -> np.ndarray:
        """Returns (height, width, 3) uint8, a new array."""
        factor = self._factor
        pixels = self._camera(factor).render(render_flag_overrides=self._flags)
        if factor == 1:
            return pixels.copy()
        height, width = self._size
        blocks = pixels.reshape(height, factor, width * factor, _RGB)
        holds_sum = np.min_scalar_type(255 * factor**2)
        total = blocks.sum(axis=1, dtype=holds_sum).reshape(height, width, factor, _RGB)
        return (total.sum(axis=2, dtype=holds_sum) // factor**2).astype(np.uint8)

    def depth(self) -> np.ndarray:
        """Returns (height, width) float32 distances in m, a new array."""
        return self._camera(1).render(depth=True).copy()

    def segmentation(self) -> np.ndarray:
        """Returns (height, width, 2) int32: object id and object type, a new array."""
        return self._camera(1).render(segmentation=True).copy()


def check_name(physics: Any, name: str) -> None:
    """Raises `ValueError`, which lists the cameras of a model, if there is none of that name."""
    model = physics.model
    checks.one_of('camera', name, [model.id2name(i, 'camera') for i in range(model.ncam)])


def fit_framebuffer(buffer: Any, height: int, width: int) -> None:
    """Makes sure that pictures of that size, in pixels, can be drawn.

    Args:
        buffer: `vis.global_` of a model, or `visual.global` of MJCF. MuJoCo allocates what it
            draws into with the first picture.
        height: Height in pixels.
        width: Width in pixels.
    """
    buffer.offheight = max(buffer.offheight, height)
    buffer.offwidth = max(buffer.offwidth, width)
