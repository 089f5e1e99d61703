"""Episodes as arrays, each reproducible from task options, policy and one seed."""

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

import fetch_composer
from fetch_composer import policies
from fetch_composer.tasks import rewards


@dataclasses.dataclass(frozen=True)
class Episode:
    """What happened in an episode of T control steps.

    Attributes:
        seed: Seed of environment and policy.
        observation: (T + 1, n) observations, the first of them after the reset.
        achieved_goal: (T + 1, 3) positions in m.
        desired_goal: (T + 1, 3) positions in m.
        action: (T, 4) actions.
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
        """(T + 1,) distances to the goal in m."""
        return rewards.goal_distance(self.achieved_goal, self.desired_goal)

    @property
    def is_success(self) -> bool:
        """Whether the goal was achieved at the last step."""
        return bool(rewards.is_success(self.achieved_goal[-1], self.desired_goal[-1]))

    @property
    def total_reward(self) -> float:
        """The episode's return: the sum of its rewards, undiscounted."""
        return float(self.reward.sum())


def stack(episodes: Sequence[Episode]) -> dict[str, np.ndarray]:
    """Returns arrays over episodes of equal length, by name: those of `Episode`, (E, ...)."""
    names = ('seed', 'observation', 'achieved_goal', 'desired_goal', 'action', 'reward')
    arrays = {name: np.stack([getattr(each, name) for each in episodes]) for name in names}
    arrays['distance'] = np.stack([each.distance for each in episodes])
    arrays['is_success'] = np.array([each.is_success for each in episodes])
    return arrays


class Rollout:
    """Runs a policy on a task, with a seed for each episode."""

    def __init__(self, task: str, policy: str, **task_kwargs) -> None:
        """Loads the task and makes sure that there is such a policy.

        Args:
            task: Name of the task.
            policy: Name of the policy.
            **task_kwargs: Options of the task.

        Raises:
            ValueError: if a name or an option is not valid; the message lists those that are.
        """
        self._policy = policy
        self.env = fetch_composer.load(task, **task_kwargs)
        policies.load(policy, self.env)

    def run(self, seed: int, on_progress: Callable[[int], None] | None = None) -> Episode:
        """Returns the episode of that seed, whichever ran before it.

        It starts as the first episode of `fetch_composer.load(task, seed=seed)` does.

        Args:
            seed: A non-negative integer.
            on_progress: Called after the reset and after every step, with the steps so far.
        """
        self.env.seed(seed)
        policy = policies.load(self._policy, self.env, seed=seed)
        policy.reset()
        time_step = self.env.reset()
        on_progress = on_progress or (lambda step: None)
        on_progress(0)
        observations, actions, received, seconds = [time_step.observation], [], [], 0.0
        while not time_step.last():
            action = policy(time_step.observation)
            started = time.perf_counter()
            time_step = self.env.step(action)
            seconds += time.perf_counter() - started
            observations.append(time_step.observation)
            actions.append(action)
            received.append(time_step.reward)
            on_progress(len(actions))
        return Episode(
            seed=seed,
            **{name: np.stack([each[name] for each in observations]) for name in observations[0]},
            action=np.stack(actions),
            reward=np.array(received),
            step_seconds=seconds,
        )
