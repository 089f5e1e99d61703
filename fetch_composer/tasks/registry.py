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


class UnknownOptionError(TypeError, ValueError):
    """An option that a task does not take: a keyword, and a value among valid ones."""


def register(task_name: str, task_class: type[GoalTask]) -> None:
    """Makes a task of one's own known by name to `load`, the batch and Gymnasium's adapter.

    Raises:
        ValueError: if the name is taken.
    """
    if task_name in TASKS:
        raise ValueError(f'The name {task_name!r} is taken by {TASKS[task_name].__name__}.')
    TASKS[task_name] = task_class


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
        ValueError: if a name or the value of an option is not valid; the message lists what is.
        UnknownOptionError: if the task has no such option; it is a `ValueError` as well.
    """
    if task_name not in TASKS:
        raise ValueError(f'Unknown task {task_name!r}; valid are {", ".join(sorted(TASKS))}.')
    valid = options(task_name)
    unknown = sorted(set(task_kwargs) - set(valid))
    if unknown:
        raise UnknownOptionError(
            f'{task_name!r} got an unexpected keyword argument {", ".join(map(repr, unknown))}; '
            f'valid are {", ".join(valid)}.'
        )
    return TASKS[task_name](**task_kwargs)
