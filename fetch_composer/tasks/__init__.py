"""The Fetch tasks."""

from fetch_composer.tasks.goal_task import MAX_EPISODE_STEPS, GoalTask
from fetch_composer.tasks.push import Push
from fetch_composer.tasks.registry import ALL, make
from fetch_composer.tasks.rewards import compute_reward, is_success

__all__ = ('ALL', 'MAX_EPISODE_STEPS', 'GoalTask', 'Push', 'compute_reward', 'is_success', 'make')
