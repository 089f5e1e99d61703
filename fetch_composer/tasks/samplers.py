"""Where an episode's object starts and where its goal lies.

Each sampler is a `composer.variation.Variation`, so that it can be drawn from, combined or
replaced like any other. They draw the very numbers that Gymnasium-Robotics draws, in its order.
"""

import numpy as np
import numpy.typing as npt
from dm_control.composer import variation

_MAX_REJECTIONS = 1000


class OffsetBeyond(variation.Variation):
    """A point near a centre, but not nearer than a clearance, in the plane of the table.

    Attributes:
        centre: (2,) x and y of the centre in m.
        half_range: Each offset is uniform in [-half_range, half_range] m.
        clearance: No offset is shorter than this many m.
    """

    def __init__(self, centre: npt.ArrayLike, half_range: float, clearance: float) -> None:
        """Initializes the sampler; its arguments are its attributes.

        Raises:
            ValueError: if no offset in range is as long as the clearance.
        """
        if half_range * np.sqrt(2) <= clearance:
            raise ValueError(
                f'No offset within ±{half_range} m is longer than the clearance of {clearance} m; '
                'lower the clearance or widen the range.'
            )
        self.centre = np.array(centre, dtype=np.float64)[:2]
        self.half_range = half_range
        self.clearance = clearance

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (2,) x and y in m."""
        del initial_value, current_value  # Unused.
        for _ in range(_MAX_REJECTIONS):
            offset = random_state.uniform(-self.half_range, self.half_range, size=2)
            point = self.centre + offset
            if np.linalg.norm(point - self.centre) >= self.clearance:
                return point
        raise RuntimeError(
            f'No place at least {self.clearance} m from {self.centre} was found in '
            f'{_MAX_REJECTIONS} draws; lower the clearance or widen the range.'
        )


class GoalAround(variation.Variation):
    """A goal near a centre: in a cube around it, or at the height of the object or above it.

    Attributes:
        centre: (3,) centre in m.
        half_range: Each offset is uniform in [-half_range, half_range] m.
        height: z of the goal in m; if None, z is sampled like x and y.
        air_probability: Probability that the goal is lifted off `height`.
        air_height: A lifted goal is up to this many m above `height`.
    """

    def __init__(
        self,
        centre: npt.ArrayLike,
        half_range: float,
        height: float | None = None,
        air_probability: float = 0.0,
        air_height: float = 0.0,
    ) -> None:
        """Initializes the sampler; its arguments are its attributes."""
        self.centre = np.array(centre, dtype=np.float64)
        self.half_range = half_range
        self.height = height
        self.air_probability = air_probability
        self.air_height = air_height

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (3,) a goal in m."""
        del initial_value, current_value  # Unused.
        goal = self.centre + random_state.uniform(-self.half_range, self.half_range, size=3)
        if self.height is None:
            return goal
        goal[2] = self.height
        if self.air_probability and random_state.uniform() < self.air_probability:
            goal[2] += random_state.uniform(0, self.air_height)
        return goal


class Apart(variation.Variation):
    """Places of several objects, or of their goals, each drawn alike and apart from the others."""

    def __init__(self, sampler: variation.Variation, count: int, distance: float) -> None:
        """Initializes the sampler.

        Args:
            sampler: Draws a place: (2,) or (3,) in m.
            count: How many places.
            distance: In the plane of the table places are at least so many m apart, and goals as
                far from where the other objects start.
        """
        self._sampler = sampler
        self._count = count
        self._distance = distance

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (2 count,) or (3 count,) in m.

        Args:
            initial_value: (2 count,) x and y in m at which the objects start, if they are not what
                is drawn.
            current_value: Unused.
            random_state: What to draw from.
        """
        del current_value  # Unused.
        starts = np.reshape([] if initial_value is None else initial_value, (-1, 2))
        for _ in range(_MAX_REJECTIONS):
            places = [self._sampler(random_state=random_state) for _ in range(self._count)]
            if self._are_apart(places, starts):
                return np.concatenate(places)
        raise RuntimeError(
            f'{self._count} places at least {self._distance} m apart were not found in '
            f'{_MAX_REJECTIONS} draws; lower the distance or widen the range.'
        )

    def _are_apart(self, places: list[np.ndarray], starts: np.ndarray) -> bool:
        pairs = [(one, other) for i, one in enumerate(places) for other in places[:i]]
        for i, start in enumerate(starts):
            pairs += [(place, start) for j, place in enumerate(places) if j != i]
        return all(np.linalg.norm(one[:2] - other[:2]) >= self._distance for one, other in pairs)
