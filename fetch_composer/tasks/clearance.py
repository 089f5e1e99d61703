"""What keeps objects and props from starting at a place: the gripper, obstacles, one another."""

from collections.abc import Mapping, Sequence

import numpy as np

from fetch_composer.entities import Obstacle
from fetch_composer.entities.solids import Solid
from fetch_composer.tasks.scene import Prop, Scene
from fetch_composer.tasks.variations import Variations

FINGERTIP_DEPTH = 0.0185  # m, of the fingertips below the observed site.
# An object's rim is at least so far, in m, from the axis of a gripper that is as low as it is.
_GRIPPER_REACH = 0.0646

_NOTHING: Mapping[str, np.ndarray] = {}


class Clearance:
    """Says what is in the way of the objects of a task."""

    def __init__(self, scene: Scene, grip_start: np.ndarray, variations: Variations) -> None:
        """Initializes it.

        Args:
            scene: The scene.
            grip_start: (3,) usual start of the observed grip site in m.
            variations: What else differs between episodes.
        """
        self._scene = scene
        self._grip_start = grip_start
        self._variations = variations

    def in_the_way(
        self, object_position: np.ndarray | None, values: Mapping[str, np.ndarray] = _NOTHING
    ) -> str | None:
        """Returns what keeps objects from starting there, as a message; None if nothing does.

        Args:
            object_position: (2 n,) x and y in m of each object; None without one.
            values: What was drawn for the episode; nothing for the usual objects and start.
        """
        if object_position is None:
            return None
        solids = self._variations.solids(values)
        places = object_position.reshape(-1, 2)
        at = f'object_position {object_position.tolist()} is where'
        for i, (place, solid) in enumerate(zip(places, solids, strict=True)):
            radius = solid.reach
            grip = self._gripper_beside(solid, values)
            needed = radius + _GRIPPER_REACH
            if grip is not None and np.linalg.norm(place - grip) < needed:
                return (
                    f'{at} the gripper starts: it must be at least {needed:.3f} m from '
                    f'{grip.round(4).tolist()}.'
                )
            for each in self._scene.obstacles:
                if _distance(place, each) < radius:
                    return (
                        f'{at} an obstacle stands: it must be at least {radius:.3f} m from the '
                        f'{(2 * each.half_size[:2]).round(4).tolist()} m around '
                        f'{each.position[:2].round(4).tolist()}.'
                    )
            for other, other_solid in zip(places[:i], solids, strict=False):
                if np.linalg.norm(place - other) < radius + other_solid.reach:
                    return (
                        f'{at} two objects meet: they must be at least '
                        f'{radius + other_solid.reach:.3f} m apart.'
                    )
        return None

    def is_clear(
        self,
        prop: Prop,
        place: np.ndarray,
        occupied: Sequence[tuple[np.ndarray, float]],
        values: Mapping[str, np.ndarray],
    ) -> bool:
        """Returns whether a prop may start at a place.

        Args:
            prop: A prop whose place is drawn.
            place: (2,) x and y in m.
            occupied: x and y, (2,), and radius, in m, of what else stands on the table.
            values: What was drawn for the episode.
        """
        solid, workspace = prop.block.solid, self._scene.workspace
        reach = solid.reach
        if (np.abs(place - workspace.table_position[:2]) > workspace.table_half_size[:2]).any():
            return False
        if any(_distance(place, each) < reach for each in self._scene.obstacles):
            return False
        grip = self._gripper_beside(solid, values)
        if grip is not None:
            occupied = [*occupied, (grip, _GRIPPER_REACH)]
        return all(np.linalg.norm(place - other) >= reach + radius for other, radius in occupied)

    def _gripper_beside(self, solid: Solid, values: Mapping[str, np.ndarray]) -> np.ndarray | None:
        """Returns (2,) where the gripper starts, if it is as low as a solid on the table."""
        grip = self._grip_start + values.get('gripper_offset', 0.0)
        top = self._scene.workspace.table_top + 2 * solid.half_extents[2]
        return grip[:2] if grip[2] - FINGERTIP_DEPTH < top else None

    def occupied(
        self,
        object_position: np.ndarray | None,
        goal: np.ndarray,
        values: Mapping[str, np.ndarray],
    ) -> list[tuple[np.ndarray, float]]:
        """Returns x and y, (2,), and radius, in m, of objects, their goals, and props in place."""
        props = [each for each in self._scene.props if each.sampler is None]
        found = [(each.position[:2], each.block.solid.reach) for each in props]
        if object_position is not None:
            solids = self._variations.solids(values)
            for places in (object_position.reshape(-1, 2), goal.reshape(-1, 3)[:, :2]):
                found += [(at, each.reach) for at, each in zip(places, solids, strict=True)]
        return found


def _distance(place: np.ndarray, obstacle: Obstacle) -> float:
    """Returns the distance in m of a place, (2,), from an obstacle, seen from above."""
    beyond = np.abs(place - obstacle.position[:2]) - obstacle.half_size[:2]
    return float(np.linalg.norm(np.maximum(beyond, 0.0)))
