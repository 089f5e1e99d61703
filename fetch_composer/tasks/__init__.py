"""The Fetch tasks."""

from fetch_composer.tasks.goal_task import MAX_EPISODE_STEPS, GoalTask
from fetch_composer.tasks.pick_and_place import PickAndPlace
from fetch_composer.tasks.push import Push
from fetch_composer.tasks.reach import Reach
from fetch_composer.tasks.registry import ALL, make
from fetch_composer.tasks.rewards import compute_reward, is_success
from fetch_composer.tasks.slide import Slide

__all__ = (
    'ALL',
    'MAX_EPISODE_STEPS',
    'GoalTask',
    'PickAndPlace',
    'Push',
    'Reach',
    'Slide',
    'compute_reward',
    'is_success',
    'make',
)
