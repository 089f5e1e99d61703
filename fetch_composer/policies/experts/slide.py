"""A scripted expert for Slide: drag the puck into line with its goal, then hit it once.

The puck slides on the table, but not under the fingers: pressed from above it goes wherever they
go. To a goal within reach it is dragged all the way. For any other it is put at rest short of its
goal along x, and hit along x with the flat face of a finger: it goes straight, and how far
depends only on how hard the hit is.
"""

import dataclasses
from collections.abc import Mapping

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
_STILL_OVER = 0.03  # Fingers that have crept no further than this are still on the puck ...
_PRESSING = (0.44, _TOUCHING)  # ... at heights between these.
_ARRIVED = 0.006  # From the puck to where a drag ends.
_AT_REST = 0.004  # m per control step

# Where a hit begins: the gripper from the puck's centre, in m. They would touch at 0.0385. One
# finger hits alone: between the two is a slit of 0.002 m, in which the puck would jam.
_BEHIND = np.array((-0.0465, 0.0125))
_CLEAR = 0.042  # A gripper that is this far behind the puck can go down.
_LOW = 0.435  # Below this the gripper, still sinking, begins to hit ...
_ALIGNED = 0.006  # ... if it is no further from where a hit begins.
_STILL = 0.001  # m per control step
_LEFT_BEHIND = 0.014  # A puck at rest that is further from where a drag ends is dragged again.

# A hit is two steps of one strength, from 0 to 1, which makes the puck glide
# _FURTHEST_GLIDE * strength ** _EXPONENT m. The second makes up for what the first lacked.
_FURTHEST_GLIDE = 0.62
_EXPONENT = 1.85
_PREFERRED_GLIDE = 0.15  # Where there is a choice: the error grows with the glide.
_FIRST_SPEED = 0.0258  # m per control step of the gripper after a first step of strength 1 ...
_FIRST_WAY = 1.16  # ... and its way in m for each m per control step of that.
_TOUCHES = 0.015  # m from where a hit begins: the puck may still be at the finger ...
_RUNS_AHEAD = 1.65  # ... unless it is so many times as fast.
_SECOND_FOR_FIRST = 0.6  # How much of the second step does what one of the first would have done.

# After a hit the puck is on its way, or has arrived.
_HIT = 0.03  # m past the end of its drag.
_AT_GOAL = 0.04  # m
_LOST = 1.2  # x in m, beyond which no gripper gets on top of it.


class SlideExpert:
    """Drags and hits; each action depends on the present observation alone."""

    def reset(self) -> None:
        """Does nothing: it keeps nothing from one step to the next."""

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
        end, is_goal = _end_of_drag(view.goal)
        if _is_on_top(view, end) and (is_goal or not _lies_at(end, view)):
            return _drag(view, end)
        if is_goal:
            return _get_on_top(view, end)
        if _is_hitting(view):
            return _hit_on(view)
        if _is_at_rest(view) and _furthest(end - view.puck) < _LEFT_BEHIND:
            if _is_behind(view) and _is_still(view):
                return _hit(_strength(view, view.puck[0]))
            return _get_behind(view)
        if view.puck[0] > end[0] + _HIT and not (_is_at_rest(view) and _is_worth_another(view)):
            return motion.move(np.zeros(3))
        return _get_on_top(view, end)


@dataclasses.dataclass(frozen=True)
class _View:
    """What is seen: places in m and velocities in m per control step, (3,) or (2,) in the plane."""

    gripper: np.ndarray
    gripper_velocity: np.ndarray
    puck: np.ndarray
    puck_velocity: np.ndarray
    goal: np.ndarray


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
    return _furthest(end - view.puck) < _ARRIVED and _is_at_rest(view)


def _is_at_rest(view: _View) -> bool:
    return _furthest(view.puck_velocity) < _AT_REST


def _is_on_top(view: _View, end: np.ndarray) -> bool:
    """Returns whether the fingers press on the puck, or nearly so."""
    presses = _PRESSING[0] < view.gripper[2] < _PRESSING[1]
    return presses and _furthest(_way_on_top(view, end)) < _STILL_OVER


def _is_worth_another(view: _View) -> bool:
    """Returns whether a puck at rest is neither at its goal nor out of reach."""
    return bool(np.linalg.norm(view.goal - view.puck) > _AT_GOAL) and view.puck[0] < _LOST


def _way_behind(view: _View) -> np.ndarray:
    """Returns the way, (3,) in m, to where a hit begins."""
    return np.array((*(view.puck + _BEHIND), _HITTING_HEIGHT)) - view.gripper


def _get_behind(view: _View) -> np.ndarray:
    way = _way_behind(view)
    is_clear = view.gripper[0] < view.puck[0] - _CLEAR
    if not is_clear or _furthest(way[:2]) > motion.FURTHEST:
        way[2] = _TRAVEL_HEIGHT - view.gripper[2]
    return motion.move(way)


def _is_behind(view: _View) -> bool:
    return view.gripper[2] < _LOW and _furthest(_way_behind(view)[:2]) < _ALIGNED


def _is_still(view: _View) -> bool:
    """Returns whether nothing moves sideways, which would send the puck there."""
    return max(abs(view.gripper_velocity[1]), _furthest(view.puck_velocity)) < _STILL


def _hit(strength: float) -> np.ndarray:
    return np.array((np.clip(strength, -1, 1), 0.0, 0.0, 0.0), dtype=np.float32)


def _strength(view: _View, start: float) -> float:
    """Returns how hard to hit a puck that starts at `start`, an x in m."""
    glide = np.clip(view.goal[0] - start, 0.0, _FURTHEST_GLIDE)
    return float((glide / _FURTHEST_GLIDE) ** (1 / _EXPONENT))


def _is_hitting(view: _View) -> bool:
    """Returns whether a hit has had its first step, and not its second."""
    speed, beside = view.gripper_velocity[:2]
    is_there = view.gripper[2] < _LOW and _furthest(_way_behind(view)[:2]) < _TOUCHES
    is_coming = speed > _AT_REST > abs(beside)
    return is_there and is_coming and view.puck_velocity[0] < _RUNS_AHEAD * speed


def _hit_on(view: _View) -> np.ndarray:
    speed = view.gripper_velocity[0]
    start = view.gripper[0] - _FIRST_WAY * speed - _BEHIND[0]
    strength = _strength(view, start)
    return _hit(strength + _SECOND_FOR_FIRST * (strength - speed / _FIRST_SPEED))


def _furthest(vector: np.ndarray) -> float:
    """Returns the largest component, without its sign."""
    return float(np.abs(vector).max())
