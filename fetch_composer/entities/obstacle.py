"""What stands in the way of the object: a wall."""

from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf

from fetch_composer.entities import contacts

# Time constant in s and damping ratio of its contacts: with MuJoCo's own, the robot would press a
# block into it, and through it.
_STIFF = (0.004, 1.0)


class Obstacle(composer.Entity):
    """A box that nothing moves; the entity's frame is its centre."""

    def _build(
        self,
        position: Sequence[float],
        half_size: Sequence[float],
        rgba: Sequence[float] = (0.32, 0.34, 0.38, 1.0),
        name: str = 'obstacle',
    ) -> None:
        """Builds the obstacle.

        Args:
            position: (3,) where its centre is in an arena, in m.
            half_size: Half of its length, width and height in m.
            rgba: Colour.
            name: Name of the entity.
        """
        self._position = np.array(position, dtype=np.float64)
        self._mjcf_root = mjcf.RootElement(model=name)
        material = self._mjcf_root.asset.add(
            'material', name=name, rgba=rgba, specular=0.2, shininess=0.2
        )
        self._geom = self._mjcf_root.worldbody.add(
            'geom',
            name=name,
            type='box',
            size=half_size,
            material=material,
            solref=_STIFF,
            priority=1,  # So that this holds whatever touches it.
            **contacts.SCENERY_CONTACT,
        )

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def position(self) -> np.ndarray:
        """(3,) where its centre is in an arena, in m."""
        return self._position

    @property
    def half_size(self) -> np.ndarray:
        """(3,) half of its length, width and height in m."""
        return self._geom.size
