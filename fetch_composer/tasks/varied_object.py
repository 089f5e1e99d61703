"""What variations know of an object: its shape, and where it is in the compiled model."""

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np
from dm_control import mjcf


def inertia(geom_type: int, size: np.ndarray, mass: float) -> np.ndarray:
    """Returns (3,) moments of inertia in kg m² of a uniform box or cylinder."""
    if geom_type == mujoco.mjtGeom.mjGEOM_BOX:
        square = size**2
        return mass / 3 * (square.sum() - square)
    radius, half_height = size[:2]
    across = mass * (3 * radius**2 + 4 * half_height**2) / 12
    return np.array((across, across, mass * radius**2 / 2))


def _bounds(geom_type: int, size: np.ndarray) -> np.ndarray:
    """Returns (3,) half extents in m of a box or cylinder in its own frame."""
    if geom_type == mujoco.mjtGeom.mjGEOM_BOX:
        return size
    return np.array((size[0], size[0], size[1]))


@dataclasses.dataclass
class VariedObject:
    """An object of the scene, of which size and mass may vary.

    Attributes:
        geom: Its geom.
        geom_type: Type of that in MuJoCo.
        size: (3,) its usual size in m, as MuJoCo has it.
        id: Id of its geom in the compiled model, as those that follow.
        body: Id of its body.
        bounding_volume: Index of its bounding volume.
        material: Id of its material.
        mass: Its usual mass in kg.
    """

    geom: mjcf.Element
    geom_type: int
    size: np.ndarray
    id: int = 0
    body: int = 0
    bounding_volume: int = 0
    material: int = 0
    mass: float = 0.0

    @classmethod
    def of(cls, geom: mjcf.Element) -> 'VariedObject':
        """Returns what is known before the model is compiled."""
        size: np.ndarray = np.zeros(3)
        size[: len(geom.size)] = geom.size
        return cls(geom, getattr(mujoco.mjtGeom, f'mjGEOM_{geom.type.upper()}'), size)

    def compile(self, physics: mjcf.Physics) -> None:
        """Looks up where it is in the compiled model."""
        model = physics.model.ptr
        self.id = physics.bind(self.geom).element_id
        self.body = model.geom_bodyid[self.id]
        self.bounding_volume = model.body_bvhadr[self.body]
        self.material = model.geom_matid[self.id]
        self.mass = float(model.body_mass[self.body])

    @property
    def is_box(self) -> bool:
        """Whether it is a box; else it is a cylinder."""
        return self.geom_type == mujoco.mjtGeom.mjGEOM_BOX

    def size_in(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns (3,) its size in an episode for which values were drawn.

        Raises:
            ValueError: if what was drawn has as many sizes as another shape.
        """
        size, drawn = self.size.copy(), values.get('object_size')
        used = 3 if self.is_box else 2
        if drawn is not None:
            if drawn.size not in (1, used):
                raise ValueError(
                    f"'object_size' drew {drawn.tolist()}, but this object has {used} sizes."
                )
            size[:used] = drawn
        return size

    def half_extents(self, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns (3,) half of the upright object's length, width and height in m."""
        return _bounds(self.geom_type, self.size_in(values))
