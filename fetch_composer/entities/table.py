"""The table on which the tasks take place."""

from collections.abc import Sequence

from dm_control import composer, mjcf

from fetch_composer.entities import contacts


class Table(composer.Entity):
    """A box; the entity's frame is its centre."""

    def _build(
        self,
        half_size: Sequence[float] = (0.25, 0.35, 0.2),
        friction: Sequence[float] = (1.0, 0.005, 0.0001),
        name: str = 'table',
    ) -> None:
        """Builds the table.

        Args:
            half_size: Half of its length, width and height in m.
            friction: Sliding, torsional and rolling coefficients; in a contact, MuJoCo takes
                the larger of these and the other geom's.
            name: Name of the entity.
        """
        self._mjcf_root = mjcf.RootElement(model=name)
        material = self._mjcf_root.asset.add(
            'material', name='wood', rgba=(0.72, 0.6, 0.45, 1), specular=0.1, shininess=0.1
        )
        self._geom = self._mjcf_root.worldbody.add(
            'geom',
            name='table',
            type='box',
            size=half_size,
            friction=friction,
            material=material,
            **contacts.SCENERY_CONTACT,
        )

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def geom(self) -> mjcf.Element:
        """The table's only geom."""
        return self._geom
