"""A scripted expert for Slide: drag the puck into line with its goal, then hit it once.

The puck slides on the table, but not under the fingers: pressed from above it goes wherever they
go. To a goal within reach it is dragged all the way. For any other it is put at rest short of its
goal along x, and hit along x with the flat face of a finger: it goes straight, and how far
depends only on how hard the hit is.

It reads positions and velocities, which are the same in both conventions.
"""

import dataclasses
from collections.abc import Generator, Mapping

import numpy as np

from fetch_composer.policies import motion

# A drag ends within this circle about the shoulder: (x, y) and radius in m. The arm reaches a
# little further, but no longer at its full speed.
_SHOULDER = np.array((0.45, 0.75))
_REACH = 0.71

# Heights of the observed grip site in m. The fingertips are 0.0185 m below it, the puck's top is
# at 0.44 and the table's surface at 0.4.
_TRAVEL_HEIGHT = 0.487
_TOUCHING = 0.4615
_PRESSING_HEIGHT = 0.455  # Where a light pressure sends it: harder, and the puck creeps faster.
_HITTING_HEIGHT = 0.4235

# A drag, in m. The fingers begin it behind the puck's centre, of which they creep ahead.
_TRAIL = 0.01
_OVER = 0.02  # So near to the place where they press the fingers go down ...
_ON = 0.01  # ... and so near they have hold of the puck.
_ARRIVED = 0.006  # From the puck to where a drag ends.
_AT_REST = 0.004  # m per control step

# Where a hit begins: the gripper from the puck's centre, in m. They touch at 0.0385. The fingers
# are 0.002 m apart, and the puck would jam between them, so one of them has to hit it alone.
_BEHIND = np.array((-0.0465, 0.0125))
_CLEAR = 0.042  # A gripper that is this far behind the puck can go down.
_PLACED = 0.0015
_LEVEL = 0.003
_STILL = 0.002  # m per control step

# A hit is _HIT_STEPS times the same action. Its strength, from 0 to 1, makes the puck glide
# _FURTHEST_GLIDE * strength ** _EXPONENT m.
_HIT_STEPS = 2
_FURTHEST_GLIDE = 0.62
_EXPONENT = 1.85
_PREFERRED_GLIDE = 0.15  # Where there is a choice: the error grows with the glide.


@dataclasses.dataclass(frozen=True)
class _View:
    """What is seen: positions in m, (2,) on the table, and velocities in m per control step."""

    gripper: np.ndarray
    height: float
    gripper_velocity: np.ndarray
    puck: np.ndarray
    puck_velocity: np.ndarray
    goal: np.ndarray

    @classmethod
    def of(cls, observation: Mapping[str, np.ndarray]) -> '_View':
        seen = observation['observation']
        return cls(
            gripper=seen[:2],
            height=seen[2],
            gripper_velocity=seen[20:23],
            puck=seen[3:5],
            puck_velocity=seen[14:17] + seen[20:23],
            goal=observation['desired_goal'][:2],
        )


class SlideExpert:
    """Plays one plan an episode, whose every step depends on what is seen."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets the episode so far; call it at the start of each."""
        self._plan: Generator[np.ndarray, _View, None] | None = None

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32, for an observation of Slide in either convention."""
        view = _View.of(observation)
        if self._plan is None:
            self._plan = _plan(view)
            return next(self._plan)
        return self._plan.send(view)


def _plan(view: _View) -> Generator[np.ndarray, _View, None]:
    """Yields an action for each view that is sent."""
    end, within_reach = _end_of_drag(view.goal)
    while view.height > _TOUCHING or not _near(view.gripper, _grasp(view, end), _ON):
        view = yield _get_on_top(view, end)
    while within_reach or not _rests_at(view, end):
        view = yield _drag(view, end)
    while not _ready_to_hit(view):
        view = yield _get_behind(view)
    hit = _hit(view)
    for _ in range(_HIT_STEPS):
        view = yield hit
    while True:
        view = yield motion.move(np.zeros(3))


def _end_of_drag(goal: np.ndarray) -> tuple[np.ndarray, bool]:
    """Returns where a drag ends, (2,) in m, and whether that is at the goal."""
    beside = goal[1] - _SHOULDER[1]
    furthest = _SHOULDER[0] + np.sqrt(max(_REACH**2 - beside**2, 0.0))
    if goal[0] <= furthest:
        return goal, True
    return np.array((min(goal[0] - _PREFERRED_GLIDE, furthest), goal[1])), False


def _grasp(view: _View, end: np.ndarray) -> np.ndarray:
    """Returns where the gripper presses on the puck, (2,) in m, to drag it to its end."""
    way = end - view.puck
    return view.puck - _TRAIL * way / max(np.linalg.norm(way), _ARRIVED)


def _get_on_top(view: _View, end: np.ndarray) -> np.ndarray:
    place = _grasp(view, end)
    height = _PRESSING_HEIGHT if _near(view.gripper, place, _OVER) else _TRAVEL_HEIGHT
    return motion.move([*(place - view.gripper), height - view.height])


def _drag(view: _View, end: np.ndarray) -> np.ndarray:
    way = end - view.puck
    way = way / max(1.0, np.abs(way).max() / motion.FURTHEST)  # Straight, however long it is.
    return motion.move([*way, _PRESSING_HEIGHT - view.height])


def _rests_at(view: _View, end: np.ndarray) -> bool:
    return _near(view.puck, end, _ARRIVED) and np.linalg.norm(view.puck_velocity) < _AT_REST


def _get_behind(view: _View) -> np.ndarray:
    way = view.puck + _BEHIND - view.gripper
    is_clear = view.gripper[0] < view.puck[0] - _CLEAR
    height = _HITTING_HEIGHT if is_clear else _TRAVEL_HEIGHT
    return motion.move([*way, height - view.height])


def _ready_to_hit(view: _View) -> bool:
    return (
        _near(view.gripper, view.puck + _BEHIND, _PLACED)
        and abs(view.height - _HITTING_HEIGHT) < _LEVEL
        and np.linalg.norm(view.gripper_velocity) < _STILL
    )


def _hit(view: _View) -> np.ndarray:
    glide = np.clip(view.goal[0] - view.puck[0], 0.0, _FURTHEST_GLIDE)
    return np.array(((glide / _FURTHEST_GLIDE) ** (1 / _EXPONENT), 0, 0, 0), dtype=np.float32)


def _near(place: np.ndarray, other: np.ndarray, distance: float) -> bool:
    """Returns whether two places differ by less than a distance along each axis."""
    return bool(np.abs(place - other).max() < distance)
