"""The way of a block on the table around something that stands there."""

import dataclasses
from collections.abc import Sequence

import numpy as np

_BLOCK = 0.045  # m from a block's centre to an obstacle that it passes: half of its diagonal, more.
_SLACK = 0.012  # m by which a block may cut a corner.


@dataclasses.dataclass(frozen=True)
class Obstacle:
    """A rectangle along x and y.

    Attributes:
        centre: (2,) x and y in m.
        half_size: (2,) half of its length and width in m.
    """

    centre: np.ndarray
    half_size: np.ndarray

    def corners(self, margin: float) -> np.ndarray:
        """Returns (4, 2) corners in m of the rectangle widened by a margin, around it."""
        signs = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1)))
        return self.centre + signs * (self.half_size + margin)

    def meets(self, start: np.ndarray, end: np.ndarray, margin: float) -> bool:
        """Returns whether a straight way, in m, leads through it, widened by a margin."""
        way = end - start
        steps = np.where(np.abs(way) < 1e-9, 1e-9, way)
        ways_to_sides = np.stack((self.half_size + margin, -self.half_size - margin))
        shares = (self.centre + ways_to_sides - start) / steps
        enters, leaves = shares.min(axis=0).max(), shares.max(axis=0).min()
        return bool(max(enters, 0.0) < min(leaves, 1.0))


def first_leg(block: np.ndarray, goal: np.ndarray, obstacles: Sequence[Obstacle]) -> np.ndarray:
    """Returns (2,) the first place, in m, that a block is to be pushed to on its way to a goal."""
    for obstacle in obstacles:
        if obstacle.meets(block, goal, _BLOCK - _SLACK):
            return _around(block, goal, obstacle)
    return goal


def _around(block: np.ndarray, goal: np.ndarray, obstacle: Obstacle) -> np.ndarray:
    """Returns the first corner of the shorter of two ways around an obstacle."""
    corners = obstacle.corners(_BLOCK)

    def is_free(start: np.ndarray, end: np.ndarray) -> bool:
        return not obstacle.meets(start, end, _BLOCK - _SLACK)

    # A way is one corner, or two that are neighbours; the goal must be seen from the last.
    ways = [[corner] for corner in corners]
    ways += [[corners[i], corners[j]] for i in range(4) for j in ((i + 1) % 4, (i - 1) % 4)]
    free = [way for way in ways if is_free(way[-1], goal)] or ways
    seen = [way for way in free if is_free(block, way[0])] or free

    def length(way: list[np.ndarray]) -> float:
        places = [block, *way, goal]
        legs = zip(places[:-1], places[1:], strict=True)
        return float(sum(np.linalg.norm(end - start) for start, end in legs))

    return min(seen, key=length)[0]
