"""What happens in the rows of a batch, until the first episode of each has ended."""

from collections.abc import Mapping, Sequence

import dm_env
import numpy as np

from fetch_composer.explorer.episodes.episode import Episode


class Recording:
    """Takes down the first episodes of the first rows of a batch.

    Attributes:
        seeds: Seeds of those rows.
        running: (n,) which of them have not ended.
    """

    def __init__(self, seeds: Sequence[int], observation: Mapping[str, np.ndarray]) -> None:
        """Begins after a reset.

        Args:
            seeds: Seeds of those rows.
            observation: What the batch has observed; it may have further rows.
        """
        self.seeds = seeds
        self._observations = [self._of_rows(observation)]
        self._actions: list[np.ndarray] = []
        self._rewards: list[np.ndarray] = []
        self._lengths = np.zeros(len(seeds), dtype=np.int64)
        self._past = 0  # Steps that were not made here.
        self._seconds = np.zeros(len(seeds))
        self.running: np.ndarray = np.ones(len(seeds), dtype=bool)

    @property
    def steps(self) -> int:
        """Control steps so far."""
        return len(self._actions)

    @property
    def observation(self) -> dict[str, np.ndarray]:
        """The latest observations, (n, ...); copies, since a policy may write to them."""
        return {name: value.copy() for name, value in self._observations[-1].items()}

    def _of_rows(self, observation: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {name: value[: len(self.seeds)] for name, value in observation.items()}

    def add(self, action: np.ndarray, time_step: dm_env.TimeStep, seconds: float) -> None:
        """Takes down a control step.

        Args:
            action: Actions of all rows.
            time_step: What followed.
            seconds: What the step took, for each of the rows.
        """
        self._add(action, time_step.reward, time_step.observation)
        self._seconds[self.running] += seconds
        self.running &= time_step.step_type[: len(self.seeds)] != dm_env.StepType.LAST

    def add_past(
        self, action: np.ndarray, reward: np.ndarray, observation: Mapping[str, np.ndarray]
    ) -> None:
        """Takes down a control step of all rows, of which none has ended, made elsewhere."""
        self._add(action, reward, observation)
        self._past += 1

    def _add(
        self, action: np.ndarray, reward: np.ndarray, observation: Mapping[str, np.ndarray]
    ) -> None:
        self._actions.append(action[: len(self.seeds)])
        self._rewards.append(reward[: len(self.seeds)])
        self._observations.append(self._of_rows(observation))
        self._lengths += self.running

    def episodes(self) -> list[Episode]:
        """Returns the episodes, once they have ended."""
        observations = {
            name: np.stack([each[name] for each in self._observations])
            for name in self._observations[0]
        }
        steps = {'action': np.stack(self._actions), 'reward': np.stack(self._rewards)}

        def of_row(array: np.ndarray, row: int, length: int) -> np.ndarray:
            return np.ascontiguousarray(array[:length, row])

        return [
            Episode(
                seed=seed,
                **{name: of_row(array, row, length + 1) for name, array in observations.items()},
                **{name: of_row(array, row, length) for name, array in steps.items()},
                # As though all steps had been made here.
                step_seconds=float(self._seconds[row]) * length / (length - self._past),
            )
            for row, (seed, length) in enumerate(
                zip(self.seeds, self._lengths.tolist(), strict=True)
            )
        ]
