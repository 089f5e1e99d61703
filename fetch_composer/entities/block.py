"""The object that is pushed, slid or lifted."""

from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer import define
from dm_control.composer.observation import observable

from fetch_composer.entities import contacts

_JOINT_DAMPING = 0.01  # Of each of the six degrees of freedom, in Gymnasium-Robotics.


class Block(composer.Entity):
    """A free rigid body with one geom and an observed site at its centre."""

    def _build(
        self,
        geom_type: str = 'box',
        size: Sequence[float] = (0.025, 0.025, 0.025),
        mass: float = 2.0,
        friction: Sequence[float] = (1.0, 0.005, 0.0001),
        quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        rgba: Sequence[float] = (0.1, 0.5, 0.32, 1.0),
        name: str = 'block',
    ) -> None:
        """Builds the block.

        Args:
            geom_type: A geom type of MuJoCo, such as 'box' or 'cylinder'.
            size: Its size in m, as MuJoCo wants it for that type.
            mass: Mass in kg.
            friction: Sliding, torsional and rolling coefficients; in a contact, MuJoCo takes
                the larger of these and the other geom's.
            quaternion: Orientation (w, x, y, z) at which an episode starts the block's frame.
                Geom and site are counter-rotated, so that they then stand upright and the
                site's Euler angles start at 0, far from their singularity.
            rgba: Colour.
            name: Name of the entity.
        """
        self._quaternion = np.array(quaternion, dtype=np.float64)
        upright = self._quaternion * (1, -1, -1, -1)
        self._mjcf_root = mjcf.RootElement(model=name)
        material = self._mjcf_root.asset.add(
            'material', name='block', rgba=rgba, specular=0.4, shininess=0.4
        )
        self._geom = self._mjcf_root.worldbody.add(
            'geom',
            name='block',
            type=geom_type,
            size=size,
            mass=mass,
            friction=friction,
            quat=upright,
            material=material,
            **contacts.PROP_CONTACT,
        )
        self._site = self._mjcf_root.worldbody.add(
            'site', name='block', quat=upright, size=(0.005,), group=4
        )

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
    def half_height(self) -> float:
        """Half of the upright block's height in m."""
        return self._geom.size[1 if self._geom.type == 'cylinder' else 2]

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
