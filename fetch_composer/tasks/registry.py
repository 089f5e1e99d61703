"""The tasks by name, and the options that each takes."""

import inspect

from fetch_composer.tasks.goal_task import GoalTask
from fetch_composer.tasks.pick_and_place import PickAndPlace
from fetch_composer.tasks.push import Push
from fetch_composer.tasks.reach import Reach
from fetch_composer.tasks.slide import Slide

TASKS: dict[str, type[GoalTask]] = {
    'pick_and_place': PickAndPlace,
    'push': Push,
    'reach': Reach,
    'slide': Slide,
}
ALL = tuple(sorted(TASKS))

# What a task class passes to `GoalTask` itself.
_FIXED_BY_TASK = frozenset({'self', 'name', 'workspace', 'block', 'locked_gripper', 'options'})


def options(task_name: str) -> tuple[str, ...]:
    """Returns the names of the options that a task takes."""
    names = set(inspect.signature(TASKS[task_name].__init__).parameters)
    names.update(inspect.signature(GoalTask.__init__).parameters)
    return tuple(sorted(names - _FIXED_BY_TASK))


def make(task_name: str, **task_kwargs) -> GoalTask:
    """Returns a task.

    Args:
        task_name: One of `ALL`.
        **task_kwargs: Its options; see `GoalTask`.

    Raises:
        ValueError: if a name, an option or its value is not valid; the message lists what is.
    """
    if task_name not in TASKS:
        raise ValueError(f'Unknown task {task_name!r}; valid are {", ".join(ALL)}.')
    valid = options(task_name)
    unknown = sorted(set(task_kwargs) - set(valid))
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(repr, unknown))} of {task_name!r}; '
            f'valid are {", ".join(valid)}.'
        )
    return TASKS[task_name](**task_kwargs)
