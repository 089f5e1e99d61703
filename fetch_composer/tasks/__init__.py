"""The Fetch tasks."""

from fetch_composer.tasks.goal_task import GoalTask
from fetch_composer.tasks.push import Push
from fetch_composer.tasks.rewards import compute_reward, is_success

__all__ = ('GoalTask', 'Push', 'compute_reward', 'is_success')
