"""The object that is pushed, slid or lifted."""

import os
from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer import define
from dm_control.composer.observation import observable

from fetch_composer.entities import contacts, mesh_solids, shapes, solids

# (w, x, y, z) of a geom none of whose axes is that of its body.
_ASKEW = (0.5, 0.5, 0.5, 0.5)
_JOINT_DAMPING = 0.01  # Of each of the six degrees of freedom, in Gymnasium-Robotics.


class Block(composer.Entity):
    """A free rigid body with one geom and an observed site at its centre."""

    def _build(
        self,
        geom_type: str = 'box',
        size: Sequence[float] | None = None,
        mass: float = 2.0,
        friction: Sequence[float] = (1.0, 0.005, 0.0001),
        quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        rgba: Sequence[float] = (0.1, 0.5, 0.32, 1.0),
        name: str = 'block',
        mesh: str | os.PathLike | None = None,
    ) -> None:
        """Builds the block.

        Args:
            geom_type: 'box', 'cylinder', 'capsule', or 'ellipsoid'.
            size: Its size in m, as MuJoCo wants it for that type; of a mesh, half of its bounding
                box. None for the default of the type, about that of a cube of 5 cm.
            mass: Mass in kg.
            friction: Sliding, torsional and rolling coefficients; in a contact, MuJoCo takes
                the larger of these and the other geom's.
            quaternion: Orientation (w, x, y, z) at which an episode starts the block's frame.
                Geom and site are counter-rotated, so that they then stand upright and the
                site's Euler angles start at 0, far from their singularity.
            rgba: Colour.
            name: Name of the entity.
            mesh: The .obj or .stl file of a mesh; then `geom_type` is of no account.

        Raises:
            ValueError: if it cannot have such a shape; the message says what would be valid.
        """
        self._quaternion = np.array(quaternion, dtype=np.float64)
        self._upright = self._quaternion * (1, -1, -1, -1)
        self._mjcf_root = mjcf.RootElement(model=name)
        material = self._mjcf_root.asset.add(
            'material', name='block', rgba=rgba, specular=0.4, shininess=0.4
        )
        self._geom = self._mjcf_root.worldbody.add(
            'geom',
            name='block',
            mass=mass,
            friction=friction,
            material=material,
            **contacts.PROP_CONTACT,
        )
        self._mesh: mjcf.Element | None = None
        self._mesh_solid: mesh_solids.Mesh | None = None
        self.take_shape(shapes.make(geom_type, size) if mesh is None else shapes.mesh(mesh, size))
        self._site = self._mjcf_root.worldbody.add(
            'site', name='block', quat=self._upright, size=(0.005,), group=4
        )

    def take_shape(self, solid: solids.Solid) -> None:
        """Gives the block another shape, before its model is compiled; all else stays."""
        self._solid = solid
        if isinstance(solid, mesh_solids.Mesh):
            if solid is not self._mesh_solid:
                self.know_mesh(solid)
            self._geom.mesh = self._mesh
        else:
            del self._geom.mesh
        self._geom.type = solid.shape
        if solid.shape == shapes.MESH:
            del self._geom.size
        else:
            self._geom.size = solid.size
        self._geom.quat = solids.turned(self._upright, solid.quaternion)

    def know_mesh(self, solid: mesh_solids.Mesh) -> None:
        """Gives the block's model a mesh that it may become."""
        if self._mesh is not None:
            self._mesh.remove()
        self._mesh = self._mjcf_root.asset.add('mesh', name='block', **solid.attributes)
        self._mesh_solid = solid

    def allow_any_shape(self) -> None:
        """Prepares the block to be given other shapes once its model is compiled.

        MuJoCo takes shortcuts for a body whose geom is aligned with it, which would hold for
        shapes that are not.
        """
        self._geom.quat = _ASKEW

    def _build_observables(self):
        return BlockObservables(self)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def geom(self) -> mjcf.Element:
        """The block's only geom."""
        return self._geom

    @property
    def site(self) -> mjcf.Element:
        """The observed site at the block's centre."""
        return self._site

    @property
    def rgba(self) -> np.ndarray:
        """(4,) colour of the block."""
        return self._geom.material.rgba

    @property
    def solid(self) -> solids.Solid:
        """Shape and size of the block."""
        return self._solid

    @property
    def mesh(self) -> mjcf.Element | None:
        """The mesh that the block is, or may become."""
        return self._mesh

    @property
    def mesh_solid(self) -> mesh_solids.Mesh | None:
        """Shape and size of that mesh."""
        return self._mesh_solid

    @property
    def upright(self) -> np.ndarray:
        """(4,) orientation (w, x, y, z), in the block's frame, of what is upright at the start."""
        return self._upright

    @property
    def half_height(self) -> float:
        """Half of the resting block's height in m."""
        return float(self._solid.half_extents[2])

    @property
    def quaternion(self) -> np.ndarray:
        """(4,) orientation (w, x, y, z) at which an episode starts the block's frame."""
        return self._quaternion

    def attach_to(self, arena: composer.Arena) -> mjcf.Element:
        """Adds the block to an arena as a free body and returns its joint."""
        frame = arena.attach(self)
        return frame.add('joint', name='free', type='free', damping=_JOINT_DAMPING)


class BlockObservables(composer.Observables):
    """Pose of the observed site: position (m) and rotation matrix."""

    @define.observable
    def position(self):
        return observable.MJCFFeature('xpos', self._entity.site)

    @define.observable
    def orientation(self):
        return observable.MJCFFeature('xmat', self._entity.site)
