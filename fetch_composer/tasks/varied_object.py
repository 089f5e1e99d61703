"""An object whose shape, size and mass may vary, and where these are in the compiled model."""

from collections.abc import Callable, Mapping

import numpy as np
from dm_control import mjcf

from fetch_composer.entities import Block, shapes, solids


class VariedObject:
    """An object of the scene.

    Attributes:
        id: Id of its geom in the compiled model.
        material: Id of its material.
    """

    def __init__(self, block: Block) -> None:
        self._block = block

    def compile(self, physics: mjcf.Physics) -> None:
        """Looks up where it is in the compiled model."""
        model = physics.model.ptr
        self.id = physics.bind(self._block.geom).element_id
        self.material = model.geom_matid[self.id]
        self._body = model.geom_bodyid[self.id]
        self._bounding_volume = model.body_bvhadr[self._body]
        self._usual_mass = float(model.body_mass[self._body])
        mesh = self._block.mesh
        self._mesh_id = -1 if mesh is None else physics.bind(mesh).element_id

    def solid(self, values: Mapping[str, np.ndarray]) -> solids.Solid:
        """Returns its shape and size in an episode for which values were drawn.

        Raises:
            ValueError: if what was drawn is not of its shape.
        """
        solid, shape = self._block.solid, values.get('object_shape')
        size = values.get('object_size')
        if shape is not None and shape[0] != solid.shape:
            solid = self._other(str(shape[0]))
        if size is None:
            return solid
        if solid.shape == shapes.MESH:
            raise ValueError(
                "'object_size' cannot vary for a mesh, which is scaled as it is compiled; choose "
                'its size with the option object_size.'
            )
        if size.size not in (1, solid.num_sizes):
            raise ValueError(
                f"'object_size' drew {size.tolist()}, but this object has {solid.num_sizes} sizes."
            )
        return shapes.make(solid.shape, size)

    def _other(self, shape: str) -> solids.Solid:
        if shape != shapes.MESH:
            return shapes.make(shape)
        if self._block.mesh_solid is None:
            raise ValueError(
                "'object_shape' drew 'mesh', of which there is none: choose one with the option "
                'object_mesh.'
            )
        return self._block.mesh_solid

    def write(self, values: Mapping[str, np.ndarray], field: Callable[[str], np.ndarray]) -> None:
        """Writes what was drawn for it.

        Args:
            values: What was drawn, by name.
            field: Returns a field of the model by name.
        """
        drawn = values.keys() & {'object_shape', 'object_size', 'object_mass'}
        if not drawn:
            return
        solid = self.solid(values)
        mass = float(values['object_mass'][0]) if 'object_mass' in drawn else self._usual_mass
        field('body_mass')[self._body] = mass
        field('body_inertia')[self._body] = solid.moments(mass)
        if drawn == {'object_mass'}:
            return
        position, quaternion = solid.geom_pose
        field('geom_size')[self.id] = solid.geom_size
        field('geom_rbound')[self.id] = solid.radius
        field('geom_aabb')[self.id] = solid.geom_aabb
        field('bvh_aabb')[self._bounding_volume] = solid.geom_aabb
        # Its only geom's axes are its axes of inertia.
        for name, index in (('geom_quat', self.id), ('body_iquat', self._body)):
            field(name)[index] = solids.turned(self._block.upright, quaternion)
        if 'object_shape' in drawn:
            field('geom_type')[self.id] = solid.geom_type
            field('geom_dataid')[self.id] = self._mesh_id if solid.shape == shapes.MESH else -1
            for name, index in (('geom_pos', self.id), ('body_ipos', self._body)):
                field(name)[index] = solids.rotated(position, self._block.upright)
