"""The mark that shows the desired goal."""

from collections.abc import Sequence

from dm_control import composer, mjcf
from dm_control.composer import define
from dm_control.composer.observation import observable

_RADIUS = 0.02  # m
_RED = (0.9, 0.1, 0.1, 1.0)
ACHIEVED_RGBA = (0.2, 0.8, 0.2, 1.0)  # Of a target once the goal is achieved.


class Target(composer.Entity):
    """A sphere that can be seen and not touched."""

    def _build(self, rgba: Sequence[float] = _RED, name: str = 'target') -> None:
        """Builds the target.

        Args:
            rgba: Colour while the goal is not achieved.
            name: Name of the entity.
        """
        self._mjcf_root = mjcf.RootElement(model=name)
        self._site = self._mjcf_root.worldbody.add(
            'site', name='target', type='sphere', size=(_RADIUS,), rgba=rgba, group=0
        )

    def _build_observables(self):
        return TargetObservables(self)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def site(self) -> mjcf.Element:
        """The sphere's site; its position is the desired goal."""
        return self._site


class TargetObservables(composer.Observables):
    """Position of the target in m."""

    @define.observable
    def position(self):
        return observable.MJCFFeature('xpos', self._entity.site)
