"""Policies whose action depends on the present observation alone, as those of networks do."""

from collections.abc import Callable, Mapping

import numpy as np

_Act = Callable[[Mapping[str, np.ndarray]], np.ndarray]


class NetworkPolicy:
    """Asks a network for actions, in calls of one shape.

    A matrix product may round a row otherwise where there are more or fewer rows. In calls that
    all have as many rows, an action does not depend on what else is acted on.
    """

    def __init__(self, act: _Act, rows: int, sizes: Mapping[str, int]) -> None:
        """Initializes the policy.

        Args:
            act: Takes observations, (rows, size) by name, and returns actions, (rows, n).
            rows: How many at a time. Where a row turns out to depend on the others, or the
                network refuses so many, it is 1.
            sizes: How many numbers each observation has, by name.
        """
        self._act = act
        self._rows = rows if rows > 1 and _are_rows_apart(act, rows, sizes) else 1

    def reset(self) -> None:
        """Does nothing: there is nothing to reset."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, float32."""
        return self.act_on_batch({name: value[None] for name, value in observation.items()})[0]

    def act_on_batch(self, observations: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns actions, a float32 row each, for observations, (n, size) by name."""
        count, actions = len(next(iter(observations.values()))), []
        for start in range(0, count, self._rows):
            some = {name: each[start : start + self._rows] for name, each in observations.items()}
            missing = start + self._rows - count
            if missing > 0:
                some = {
                    name: np.concatenate([each, np.repeat(each[-1:], missing, axis=0)])
                    for name, each in some.items()
                }
            actions.append(np.asarray(self._act(some), np.float32).reshape(self._rows, -1))
        return np.concatenate(actions)[:count]


def _are_rows_apart(act: _Act, rows: int, sizes: Mapping[str, int]) -> bool:
    """Returns whether each row's action is that row's alone, to the bit and wherever it stands."""
    generator = np.random.default_rng(0)
    observations = {name: generator.normal(size=(rows, size)) for name, size in sizes.items()}

    def acts(given: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.array(act(given), np.float32).reshape(rows, -1)

    def shifted(by: int) -> dict[str, np.ndarray]:
        return {name: np.roll(each, by, axis=0) for name, each in observations.items()}

    def alone(row: int) -> dict[str, np.ndarray]:
        is_row = np.arange(rows)[:, None] == row
        return {name: np.where(is_row, each, 0) for name, each in observations.items()}

    try:
        actions = acts(observations)
        return all(
            np.array_equal(acts(shifted(by)), np.roll(actions, by, axis=0))
            for by in (0, 1, rows // 2 + 1)
        ) and all(
            np.array_equal(acts(alone(row))[row], actions[row]) for row in (0, rows // 2, rows - 1)
        )
    except Exception:  # Of whatever takes no such batch.
        return False
