"""The room in which the Fetch stands: floor, sky, light and the cameras that film it."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from dm_control import composer

from fetch_composer.entities import contacts

# Name: (position in m, point looked at in m, vertical field of view in degrees).
_CAMERAS = {
    'front': ((2.55, 0.75, 1.3), (1.05, 0.75, 0.58), 42),
    'corner': ((2.2, 1.85, 1.25), (1.08, 0.72, 0.56), 42),
    'side': ((1.15, -1.25, 1.05), (1.05, 0.75, 0.58), 45),
    'top': ((1.3, 0.75, 1.75), (1.3, 0.7501, 0.4), 38),
    'close': ((1.95, 1.35, 0.85), (1.31, 0.75, 0.45), 36),
}
CAMERAS = tuple(_CAMERAS)

_LARGEST_PICTURE = (1280, 960)  # Width and height in pixels.


_LIGHT_POSITION = (2.6, 0.0, 3.2)  # m
_LIGHT_AIM = (1.1, 0.75, 0.4)  # m


def aim(position: npt.ArrayLike) -> np.ndarray:
    """Returns (3,) the direction in which a light at `position` (m) shines on the table."""
    return np.subtract(_LIGHT_AIM, position)


def _look_at(position: Sequence[float], point: Sequence[float]) -> tuple[float, ...]:
    """Returns MuJoCo's `xyaxes` of an upright camera at `position` that sees `point`."""
    forward = [b - a for a, b in zip(position, point, strict=True)]
    right = (forward[1], -forward[0], 0.0)
    up = (
        right[1] * forward[2] - right[2] * forward[1],
        right[2] * forward[0] - right[0] * forward[2],
        right[0] * forward[1] - right[1] * forward[0],
    )
    return (*right, *up)


class Arena(composer.Arena):
    """A floor under a sky, lit from above, with named cameras around the table."""

    def _build(self, name: str = 'arena') -> None:
        super()._build(name=name)
        # MuJoCo's defaults, which composer.Arena overrides.
        self.mjcf_model.option.cone = 'pyramidal'
        self.mjcf_model.option.noslip_iterations = 0
        self._add_floor()
        self._add_light()
        # Without a GPU, edges that MuJoCo smooths take most of a picture's time.
        self.mjcf_model.visual.quality.offsamples = 0
        self.mjcf_model.visual.quality.shadowsize = 1024
        visual_global = getattr(self.mjcf_model.visual, 'global')
        visual_global.offwidth, visual_global.offheight = _LARGEST_PICTURE
        self.mjcf_model.visual.map.znear = 0.01
        self.mjcf_model.visual.map.zfar = 50
        self.mjcf_model.statistic.center = (1.1, 0.75, 0.5)
        self.mjcf_model.statistic.extent = 1.5
        for camera, (position, point, fovy) in _CAMERAS.items():
            self.mjcf_model.worldbody.add(
                'camera',
                name=camera,
                pos=position,
                xyaxes=_look_at(position, point),
                fovy=fovy,
            )

    def _add_floor(self) -> None:
        asset = self.mjcf_model.asset
        asset.add(
            'texture',
            name='sky',
            type='skybox',
            builtin='gradient',
            rgb1=(0.86, 0.9, 0.94),
            rgb2=(0.5, 0.58, 0.68),
            width=64,
            height=384,
        )
        tiles = asset.add(
            'texture',
            name='tiles',
            type='2d',
            builtin='checker',
            rgb1=(0.62, 0.64, 0.67),
            rgb2=(0.56, 0.58, 0.61),
            width=64,
            height=64,
        )
        material = asset.add(
            'material', name='tiles', texture=tiles, texrepeat=(2, 2), texuniform=True,
            specular=0.1,
        )  # fmt: skip
        self.mjcf_model.worldbody.add(
            'geom',
            name='floor',
            type='plane',
            pos=(0.8, 0.75, 0),
            size=(4, 4, 1),
            material=material,
            **contacts.SCENERY_CONTACT,
        )

    def _add_light(self) -> None:
        headlight = self.mjcf_model.visual.headlight
        headlight.ambient = (0.3, 0.3, 0.31)
        headlight.diffuse = (0.3, 0.3, 0.3)
        headlight.specular = (0.1, 0.1, 0.1)
        self._light = self.mjcf_model.worldbody.add(
            'light',
            name='key',
            pos=_LIGHT_POSITION,
            dir=aim(_LIGHT_POSITION),
            cutoff=60,
            exponent=1,
            castshadow=True,
            diffuse=(0.5, 0.49, 0.47),
            specular=(0.3, 0.3, 0.3),
        )

    @property
    def light(self):
        """The light that casts shadows."""
        return self._light
