"""Uniform solids: how they lie on a table, their extents and inertia, as MuJoCo compiles them."""

import abc
from typing import ClassVar

import mujoco
import numpy as np
import numpy.typing as npt

# Quaternions that turn an axis of a solid up, x, y or z, and which axis is then along which.
_UP = (
    (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0),
    (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),
    (1.0, 0.0, 0.0, 0.0),
)
_EXTENTS = np.array(((2, 1, 0), (0, 2, 1), (0, 1, 2)))


def turned(quaternion: npt.ArrayLike, by: npt.ArrayLike) -> np.ndarray:
    """Returns (4,) the orientation `by` in a frame of orientation `quaternion`."""
    product = np.zeros(4)
    mujoco.mju_mulQuat(product, np.array(quaternion, np.float64), np.array(by, np.float64))
    return product


def rotated(vector: npt.ArrayLike, quaternion: npt.ArrayLike) -> np.ndarray:
    """Returns (3,) a vector of a frame of an orientation in the frame around that."""
    found = np.zeros(3)
    mujoco.mju_rotVecQuat(found, np.array(vector, np.float64), np.array(quaternion, np.float64))
    return found


class Solid(abc.ABC):
    """A uniform solid, about the middle of its bounding box.

    Its geom has axes of its own, along which MuJoCo measures its size. As it rests on a table, they
    may be turned: a capsule lies, for it would not stand.

    Attributes:
        shape: MuJoCo's name of the geom's type.
        num_sizes: How many sizes it has.
        size_turns_it: Whether its size decides on which of its sides it rests.
        size: (num_sizes,) in m, as MuJoCo has them.
    """

    shape: ClassVar[str]
    num_sizes: ClassVar[int]
    size_turns_it: ClassVar[bool] = False

    def __init__(self, size: npt.ArrayLike) -> None:
        self.size = np.array(size, dtype=np.float64)

    @abc.abstractmethod
    def moments(self, mass: float) -> np.ndarray:
        """Returns (3,) moments of inertia in kg m² about the geom's axes."""

    @property
    @abc.abstractmethod
    def bounds(self) -> np.ndarray:
        """(3,) half of its bounding box along the geom's axes, in m."""

    @property
    @abc.abstractmethod
    def radius(self) -> float:
        """Radius in m of a sphere around it."""

    @property
    def is_round(self) -> bool:
        """Whether, seen from above as it rests, the corners of its bounding box are empty."""
        return True

    @property
    def upright_axis(self) -> int:
        """Which of the geom's axes is upright as it rests."""
        return 2

    @property
    def quaternion(self) -> tuple[float, ...]:
        """(w, x, y, z) of the geom as it rests."""
        return _UP[self.upright_axis]

    @property
    def half_extents(self) -> np.ndarray:
        """(3,) half of its length, width and height in m as it rests."""
        return self.bounds[_EXTENTS[self.upright_axis]]

    @property
    def reach(self) -> float:
        """Radius in m of the smallest upright cylinder around it as it rests."""
        x, y, _ = self.half_extents.tolist()
        return max(x, y) if self.is_round else float(np.hypot(x, y))

    # -- What MuJoCo makes of it -----------------------------------------------------------------

    @property
    def geom_type(self) -> int:
        """The geom's type in MuJoCo."""
        return int(getattr(mujoco.mjtGeom, f'mjGEOM_{self.shape.upper()}'))

    @property
    def geom_size(self) -> np.ndarray:
        """(3,) the geom's size in a compiled model."""
        return np.append(self.size, np.zeros(3 - self.num_sizes))

    @property
    def geom_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) position in m and (4,) quaternion of the compiled geom as it rests."""
        return np.zeros(3), np.array(self.quaternion)

    @property
    def geom_aabb(self) -> np.ndarray:
        """(6,) middle and half of the bounding box along the compiled geom's axes, in m."""
        return np.concatenate((np.zeros(3), self.bounds))


class Box(Solid):
    """Half of length, width and height."""

    shape, num_sizes = 'box', 3

    def moments(self, mass: float) -> np.ndarray:
        square = self.size**2
        return mass / 3 * (square.sum() - square)

    @property
    def bounds(self) -> np.ndarray:
        return self.size

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.size))

    @property
    def is_round(self) -> bool:
        return False


class Cylinder(Solid):
    """Radius and half of the height; it stands."""

    shape, num_sizes = 'cylinder', 2

    def moments(self, mass: float) -> np.ndarray:
        radius, half_height = self.size
        across = mass * (3 * radius**2 + 4 * half_height**2) / 12
        return np.array((across, across, mass * radius**2 / 2))

    @property
    def bounds(self) -> np.ndarray:
        return self.size[[0, 0, 1]]

    @property
    def radius(self) -> float:
        return float(np.hypot(*self.size))


class Capsule(Solid):
    """Radius, and half of the distance of the two ends' centres; it lies along x."""

    shape, num_sizes = 'capsule', 2

    def moments(self, mass: float) -> np.ndarray:
        radius, half_length = self.size
        ends = mass * 2 * radius / (2 * radius + 3 * half_length)
        middle = mass - ends
        across = middle * (3 * radius**2 + 4 * half_length**2) / 12
        across += ends * (2 / 5 * radius**2 + half_length**2 + 3 / 4 * half_length * radius)
        along = (middle / 2 + ends * 2 / 5) * radius**2
        return np.array((across, across, along))

    @property
    def bounds(self) -> np.ndarray:
        radius, half_length = self.size
        return np.array((radius, radius, radius + half_length))

    @property
    def radius(self) -> float:
        return float(self.size.sum())

    @property
    def upright_axis(self) -> int:
        return 0


class Ellipsoid(Solid):
    """Semi-axes; the shortest is upright, for it would not rest on another side."""

    shape, num_sizes, size_turns_it = 'ellipsoid', 3, True

    def moments(self, mass: float) -> np.ndarray:
        square = self.size**2
        return mass / 5 * (square.sum() - square)

    @property
    def bounds(self) -> np.ndarray:
        return self.size

    @property
    def radius(self) -> float:
        return float(self.size.max())

    @property
    def upright_axis(self) -> int:
        return 2 - int(self.size[::-1].argmin())  # The last one of several.
