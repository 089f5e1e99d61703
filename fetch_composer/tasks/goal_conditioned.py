"""What a task with a desired goal earns, and when an episode of it ends."""

import numpy as np
from dm_control import composer
from dm_env import specs

from fetch_composer.tasks.desired_goal import DesiredGoal
from fetch_composer.tasks.options import TaskOptions


class GoalConditionedTask(composer.Task):
    """A task with a desired goal.

    It is continuing, so that an episode is only ever truncated, with discount 1; unless
    `terminate_on_success` is chosen, which ends it at the goal, with discount 0.

    Attributes:
        options: The options that it was given.
        visualize_reward: Whether targets change colour while the goal is achieved.
    """

    def __init__(self, options: TaskOptions, num_goals: int) -> None:
        """Initializes the task.

        Args:
            options: What was chosen.
            num_goals: How many places the goal has.
        """
        self.options = options
        self.visualize_reward = False
        self._goal = DesiredGoal(num_goals, options.reward_type)
        self._steps_taken = 0

    @property
    def goal(self) -> np.ndarray:
        """(3,), or (3 n,) for n objects: desired goal of the present episode in m; a copy."""
        return self._goal.position

    def get_reward_spec(self) -> specs.Array:
        return self._goal.reward_spec()

    def get_reward(self, physics) -> float:
        del physics  # Unused.
        return self._goal.reward()

    def is_success(self) -> bool:
        """Returns whether the goal is achieved now: whether all is less than 0.05 m from it."""
        return self._goal.is_achieved()

    def is_terminated(self) -> bool:
        """Returns whether the episode ends because the goal is achieved now."""
        return self.options.terminate_on_success and self._goal.is_achieved()

    def is_truncated(self) -> bool:
        """Returns whether the episode has taken all of its steps."""
        limit = self.options.max_episode_steps
        return limit is not None and self._steps_taken >= limit

    def should_terminate_episode(self, physics) -> bool:
        del physics  # Unused.
        return self.is_truncated() or self.is_terminated()

    def get_discount(self, physics) -> float:
        del physics  # Unused.
        return 0.0 if self.is_terminated() else 1.0
