"""A scripted expert for Slide: drag the puck into line with its goal, then hit it once.

The puck slides on the table, but not under the fingers: pressed from above it goes wherever they
go. To a goal within reach it is dragged all the way. For any other it is put at rest short of its
goal along x, and hit along x with the flat face of a finger: it goes straight, and how far
depends only on how hard the hit is.
"""

import dataclasses
from collections.abc import Generator, Mapping

import numpy as np

from fetch_composer.policies.experts import motion
from fetch_composer.tasks.layout import WITH_OBJECT as AT

# A drag ends within this circle about the shoulder: x, y and radius in m. The arm reaches a
# little further, but no longer at its full speed.
_SHOULDER_X, _SHOULDER_Y = 0.45, 0.75
_REACH = 0.71

# Heights of the observed grip site in m. The fingertips are 0.0185 m below it, the puck's top is
# at 0.44 and the table's surface at 0.4.
_TRAVEL_HEIGHT = 0.487
_TOUCHING = 0.4615
_PRESSING_HEIGHT = 0.455  # Asked for to press lightly: the harder, the more the puck creeps.
_HITTING_HEIGHT = 0.4235

# A drag, in m. The fingers begin it behind the puck's centre, because they creep ahead of it.
_TRAIL = 0.01
_OVER = 0.015  # So near to the place where they press, the fingers go down on the puck.
_BUMPING = 0.09  # Low fingers that are this near to the puck's centre go up, and nowhere else.
_ARRIVED = 0.006  # From the puck to where a drag ends.
_AT_REST = 0.004  # m per control step

# Where a hit begins: the gripper from the puck's centre, in m. They would touch at 0.0385. One
# finger hits alone: between the two is a slit of 0.002 m, in which the puck would jam.
_BEHIND = np.array((-0.0465, 0.0125))
_CLEAR = 0.042  # A gripper that is this far behind the puck can go down.
_READY = 0.0025  # From where a hit begins ...
_STILL = 0.002  # ... and in m per control step.

# A hit is _HIT_STEPS times the same action. Its strength, from 0 to 1, makes the puck glide
# _FURTHEST_GLIDE * strength ** _EXPONENT m.
_HIT_STEPS = 2
_FURTHEST_GLIDE = 0.62
_EXPONENT = 1.85
_PREFERRED_GLIDE = 0.15  # Where there is a choice: the error grows with the glide.


class SlideExpert:
    """Plays one plan an episode, each of whose actions depends on what is observed."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets the episode so far; call it at the start of each."""
        self._plan: Generator[np.ndarray, _View, None] | None = None

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Slide in either convention."""
        seen = observation['observation']
        view = _View(
            gripper=seen[AT.grip_position],
            gripper_velocity=seen[AT.grip_velocity],
            puck=seen[AT.object_position][:2],
            puck_velocity=(seen[AT.object_velocity] + seen[AT.grip_velocity])[:2],
            goal=observation['desired_goal'][:2],
        )
        if self._plan is None:
            self._plan = _plan(view)
            return next(self._plan)
        return self._plan.send(view)


@dataclasses.dataclass(frozen=True)
class _View:
    """What is seen: places in m and velocities in m per control step, (3,) or (2,) in the plane."""

    gripper: np.ndarray
    gripper_velocity: np.ndarray
    puck: np.ndarray
    puck_velocity: np.ndarray
    goal: np.ndarray


def _plan(view: _View) -> Generator[np.ndarray, _View, None]:
    """Yields an action for each view that is sent."""
    end, is_goal = _end_of_drag(view.goal)
    while view.gripper[2] > _TOUCHING or _furthest(_way_on_top(view, end)) > _OVER:
        view = yield _get_on_top(view, end)
    while is_goal or not _lies_at(end, view):
        view = yield _drag(view, end)
    while _furthest(_way_behind(view)) > _READY or _furthest(view.gripper_velocity) > _STILL:
        view = yield _get_behind(view)
    hit = _hit(view)
    for _ in range(_HIT_STEPS):
        view = yield hit
    while True:
        view = yield motion.move(np.zeros(3))


def _end_of_drag(goal: np.ndarray) -> tuple[np.ndarray, bool]:
    """Returns where a drag ends, (2,) in m, and whether that is the goal."""
    beside = min(abs(goal[1] - _SHOULDER_Y), _REACH)
    furthest = _SHOULDER_X + np.sqrt(_REACH**2 - beside**2)
    if goal[0] <= furthest:
        return goal, True
    return np.array((min(goal[0] - _PREFERRED_GLIDE, furthest), goal[1])), False


def _way_on_top(view: _View, end: np.ndarray) -> np.ndarray:
    """Returns the way, (2,) in m, to where the fingers press on the puck to drag it."""
    to_end = end - view.puck
    trail = _TRAIL * to_end / max(np.linalg.norm(to_end), _ARRIVED)
    return view.puck - trail - view.gripper[:2]


def _get_on_top(view: _View, end: np.ndarray) -> np.ndarray:
    way, height = _way_on_top(view, end), view.gripper[2]
    if _furthest(way) < _OVER:
        return motion.move([*way, _PRESSING_HEIGHT - height])
    if height < _TOUCHING and _furthest(view.puck - view.gripper[:2]) < _BUMPING:
        way = np.zeros(2)
    return motion.move([*way, _TRAVEL_HEIGHT - height])


def _drag(view: _View, end: np.ndarray) -> np.ndarray:
    way = end - view.puck
    way = way / max(1.0, _furthest(way) / motion.FURTHEST)  # Straight, however long it is.
    return motion.move([*way, _PRESSING_HEIGHT - view.gripper[2]])


def _lies_at(end: np.ndarray, view: _View) -> bool:
    return _furthest(end - view.puck) < _ARRIVED and _furthest(view.puck_velocity) < _AT_REST


def _way_behind(view: _View) -> np.ndarray:
    """Returns the way, (3,) in m, to where a hit begins."""
    return np.array((*(view.puck + _BEHIND), _HITTING_HEIGHT)) - view.gripper


def _get_behind(view: _View) -> np.ndarray:
    way = _way_behind(view)
    if view.gripper[0] > view.puck[0] - _CLEAR:
        way[2] = _TRAVEL_HEIGHT - view.gripper[2]
    return motion.move(way)


def _hit(view: _View) -> np.ndarray:
    glide = np.clip(view.goal[0] - view.puck[0], 0.0, _FURTHEST_GLIDE)
    strength = (glide / _FURTHEST_GLIDE) ** (1 / _EXPONENT)
    return np.array((strength, 0.0, 0.0, 0.0), dtype=np.float32)


def _furthest(vector: np.ndarray) -> float:
    """Returns the largest component, without its sign."""
    return float(np.abs(vector).max())
