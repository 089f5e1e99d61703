"""Where an episode's object starts and where its goal lies.

Each sampler is a `composer.variation.Variation`, so that it can be drawn from, combined or
replaced like any other. They draw the very numbers that Gymnasium-Robotics draws, in its order.
"""

import numpy as np
import numpy.typing as npt
from dm_control.composer import variation

_MAX_REJECTIONS = 1000


class OffsetBeyond(variation.Variation):
    """A point near a centre, but not nearer than a clearance, in the plane of the table."""

    def __init__(self, centre: npt.ArrayLike, half_range: float, clearance: float) -> None:
        """Initializes the sampler.

        Args:
            centre: (2,) x and y of the centre in m.
            half_range: Each offset is uniform in [-half_range, half_range] m.
            clearance: Offsets shorter than this many m are drawn again.

        Raises:
            ValueError: if no offset in range is as long as the clearance.
        """
        if half_range * np.sqrt(2) <= clearance:
            raise ValueError(
                f'No offset within ±{half_range} m is longer than the clearance of {clearance} m; '
                'lower the clearance or widen the range.'
            )
        self._centre = np.array(centre, dtype=np.float64)[:2]
        self._half_range = half_range
        self._clearance = clearance

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (2,) x and y in m."""
        del initial_value, current_value  # Unused.
        for _ in range(_MAX_REJECTIONS):
            offset = random_state.uniform(-self._half_range, self._half_range, size=2)
            point = self._centre + offset
            if np.linalg.norm(point - self._centre) >= self._clearance:
                return point
        raise RuntimeError(
            f'No place at least {self._clearance} m from {self._centre} was found in '
            f'{_MAX_REJECTIONS} draws; lower the clearance or widen the range.'
        )


class GoalAround(variation.Variation):
    """A goal near a centre: in a cube around it, or at the height of the object or above it."""

    def __init__(
        self,
        centre: npt.ArrayLike,
        half_range: float,
        height: float | None = None,
        air_probability: float = 0.0,
        air_height: float = 0.0,
    ) -> None:
        """Initializes the sampler.

        Args:
            centre: (3,) centre in m.
            half_range: Each offset is uniform in [-half_range, half_range] m.
            height: z of the goal in m; if None, z is sampled like x and y.
            air_probability: Probability that the goal is lifted off `height`.
            air_height: A lifted goal is up to this many m above `height`.
        """
        self._centre = np.array(centre, dtype=np.float64)
        self._half_range = half_range
        self._height = height
        self._air_probability = air_probability
        self._air_height = air_height

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (3,) a goal in m."""
        del initial_value, current_value  # Unused.
        goal = self._centre + random_state.uniform(-self._half_range, self._half_range, size=3)
        if self._height is None:
            return goal
        goal[2] = self._height
        if self._air_probability and random_state.uniform() < self._air_probability:
            goal[2] += random_state.uniform(0, self._air_height)
        return goal
