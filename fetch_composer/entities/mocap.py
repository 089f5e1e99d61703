"""A mocap body: the handle by which a policy moves the gripper."""

from dm_control import composer, mjcf

# Figures of the weld in the models of Gymnasium-Robotics: MuJoCo's own defaults.
_WELD_SOLREF = (0.02, 1.0)
_WELD_SOLIMP = (0.9, 0.95, 0.001, 0.5, 2.0)
_COINCIDENT = (0, 0, 0, 1, 0, 0, 0)


class Mocap(composer.Entity):
    """A frame without mass whose pose is set from outside and to which a body can be welded."""

    def _build(self, name: str = 'mocap') -> None:
        self._mjcf_root = mjcf.RootElement(model=name)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    def attach_to(self, arena: composer.Arena) -> mjcf.Element:
        """Adds this body to an arena's world: MuJoCo allows mocap bodies nowhere else."""
        frame = arena.attach(self)
        frame.mocap = 'true'
        return frame

    def weld_to(self, body: mjcf.Element) -> mjcf.Element:
        """Welds `body` softly to this one, so that both frames coincide.

        Raises:
            RuntimeError: if this entity has not been attached to an arena.
        """
        frame = mjcf.get_attachment_frame(self._mjcf_root)
        if frame is None:
            raise RuntimeError('Attach the mocap body to an arena before welding to it.')
        return frame.root.equality.add(
            'weld',
            name='mocap_weld',
            body1=frame,
            body2=body,
            anchor=(0, 0, 0),
            relpose=_COINCIDENT,
            torquescale=1,
            solref=_WELD_SOLREF,
            solimp=_WELD_SOLIMP,
        )
