"""Episodes as arrays, each reproducible from task options, policy and one seed."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from fetch_composer.tasks import rewards


@dataclasses.dataclass(frozen=True)
class Episode:
    """What happened in an episode of T control steps.

    Attributes:
        seed: Seed of environment and policy.
        observation: (T + 1, n) observations, the first of them after the reset.
        achieved_goal: (T + 1, 3) positions in m; (T + 1, 3 n) for n objects.
        desired_goal: The same.
        action: (T, size of an action) actions.
        reward: (T,) rewards.
        step_seconds: Time spent in the environment's `step`, in s.
    """

    seed: int
    observation: np.ndarray
    achieved_goal: np.ndarray
    desired_goal: np.ndarray
    action: np.ndarray
    reward: np.ndarray
    step_seconds: float

    @property
    def steps(self) -> int:
        """Number of control steps, T."""
        return len(self.action)

    @property
    def distance(self) -> np.ndarray:
        """(T + 1,) distances to the goal in m, of the object that is furthest from it."""
        return rewards.goal_distance(self.achieved_goal, self.desired_goal)

    @property
    def is_success(self) -> bool:
        """Whether the goal was achieved at the last step."""
        return bool(rewards.is_success(self.achieved_goal[-1], self.desired_goal[-1]))

    @property
    def total_reward(self) -> float:
        """The episode's return: the sum of its rewards, undiscounted."""
        return float(self.reward.sum())


def padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Returns arrays of different lengths, (length, ...) each, as one; NaN is what they lack."""
    shape = (len(arrays), max(map(len, arrays)), *arrays[0].shape[1:])
    dtype = np.result_type(*arrays)
    result = np.full(shape, np.nan if dtype.kind == 'f' else 0, dtype)
    for row, array in zip(result, arrays, strict=True):
        row[: len(array)] = array
    return result


def held(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Returns arrays of different lengths, (length,) each, as one; each stays at its end."""
    longest = max(map(len, arrays))
    return np.stack([np.pad(each, (0, longest - len(each)), mode='edge') for each in arrays])


def seed_array(seeds: Sequence[int]) -> np.ndarray:
    """Returns seeds below 2**64 as integers; left to itself, numpy makes floats of large ones."""
    return np.array(seeds, np.int64 if max(seeds, default=0) < 2**63 else np.uint64)


def stack(episodes: Sequence[Episode]) -> dict[str, np.ndarray]:
    """Returns arrays over episodes by name: those of `Episode`, (E, ...), and `steps`, (E,).

    Episodes that are shorter than others have NaN at their ends.
    """
    names = ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward', 'distance')
    return {
        'seed': seed_array([each.seed for each in episodes]),
        'steps': np.array([each.steps for each in episodes]),
        **{name: padded([getattr(each, name) for each in episodes]) for name in names},
        'is_success': np.array([each.is_success for each in episodes]),
    }
