"""Where each part of the vector `observation` is, by name.

    index   with an object                                     without
    0-2     gripper position                                   0-2
    3-5     object position
    6-8     their difference
    9-10    displacement of the right and left finger          3-4
    11-13   object's rotation, intrinsic XYZ Euler angles
    14-16   object's linear velocity less the gripper's
    17-19   object's angular velocity
    20-22   gripper's linear velocity                          5-7
    23-24   velocity of the right and left finger              8-9

Positions are in m, angles in rad, all in global coordinates; velocities are multiplied by the
control timestep, so that they are in m or rad per control step.

With several objects the gripper's ten numbers come first, as without one; then the fifteen of each
object follow, in the order of the objects: position, difference, rotation, both velocities.
"""

from collections.abc import Iterator
from typing import NamedTuple

_ABSENT = slice(0)


class Layout(NamedTuple):
    """Slices of an observation's last axis; those of an object are empty without one."""

    size: int
    grip_position: slice
    fingers: slice
    grip_velocity: slice
    finger_velocities: slice
    object_position: slice = _ABSENT
    relative_position: slice = _ABSENT
    object_rotation: slice = _ABSENT
    object_velocity: slice = _ABSENT
    object_spin: slice = _ABSENT


WITH_OBJECT = Layout(
    size=25,
    grip_position=slice(0, 3),
    object_position=slice(3, 6),
    relative_position=slice(6, 9),
    fingers=slice(9, 11),
    object_rotation=slice(11, 14),
    object_velocity=slice(14, 17),
    object_spin=slice(17, 20),
    grip_velocity=slice(20, 23),
    finger_velocities=slice(23, 25),
)

WITHOUT_OBJECT = Layout(
    size=10,
    grip_position=slice(0, 3),
    fingers=slice(3, 5),
    grip_velocity=slice(5, 8),
    finger_velocities=slice(8, 10),
)

_OF_AN_OBJECT = (
    'object_position', 'relative_position', 'object_rotation', 'object_velocity', 'object_spin'
)  # fmt: skip
_AXES = 3


def of(count: int) -> tuple[Layout, ...]:
    """Returns a layout for each of `count` objects: where it is, and where the gripper is.

    Without an object there is one, that of the gripper alone.
    """
    if not count:
        return (WITHOUT_OBJECT,)
    if count == 1:
        return (WITH_OBJECT,)
    size = WITHOUT_OBJECT.size + count * len(_OF_AN_OBJECT) * _AXES
    return tuple(_of_several(count, size))


def of_size(size: int) -> tuple[Layout, ...]:
    """Returns the layouts of an observation of so many numbers."""
    return of((size - WITHOUT_OBJECT.size) // (len(_OF_AN_OBJECT) * _AXES))


def _of_several(count: int, size: int) -> Iterator[Layout]:
    start = WITHOUT_OBJECT.size
    for _ in range(count):
        places = {}
        for name in _OF_AN_OBJECT:
            places[name] = slice(start, start + _AXES)
            start += _AXES
        yield WITHOUT_OBJECT._replace(size=size, **places)
