"""The Fetch tasks, and what a task of one's own is made of."""

from fetch_composer.tasks import conventions, samplers, scene
from fetch_composer.tasks.goal_task import GoalTask
from fetch_composer.tasks.options import MAX_EPISODE_STEPS, TaskOptions
from fetch_composer.tasks.pick_and_place import PickAndPlace
from fetch_composer.tasks.push import Push
from fetch_composer.tasks.push_around import PushAround
from fetch_composer.tasks.push_two import PushTwo
from fetch_composer.tasks.reach import Reach
from fetch_composer.tasks.registry import (
    ALL,
    conventions_of,
    default_options,
    make,
    on_register,
    published,
    register,
)
from fetch_composer.tasks.rewards import compute_reward, is_success
from fetch_composer.tasks.scene import Workspace
from fetch_composer.tasks.slide import Slide
from fetch_composer.tasks.stack import Stack

__all__ = (
    'ALL',
    'MAX_EPISODE_STEPS',
    'GoalTask',
    'PickAndPlace',
    'Push',
    'PushAround',
    'PushTwo',
    'Reach',
    'Slide',
    'Stack',
    'TaskOptions',
    'Workspace',
    'compute_reward',
    'conventions',
    'conventions_of',
    'default_options',
    'is_success',
    'make',
    'on_register',
    'published',
    'register',
    'samplers',
    'scene',
)
