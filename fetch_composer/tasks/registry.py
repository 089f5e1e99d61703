"""The tasks by name, and what follows when there is a new one."""

import dataclasses
import inspect
from collections.abc import Callable, Sequence
from typing import TypeVar

from fetch_composer.tasks import checks
from fetch_composer.tasks.goal_task import GoalTask
from fetch_composer.tasks.options import NAMES, TaskOptions

_TASKS: dict[str, type[GoalTask]] = {}
_LISTENERS: list[Callable[[str], None]] = []

_Task = TypeVar('_Task', bound=type[GoalTask])


class UnknownOptionError(TypeError, ValueError):
    """An option that a task does not take: a keyword, and a value among valid ones."""


class TaskNames(Sequence[str]):
    """The names of all registered tasks, in order; it knows of those that are yet to come."""

    def __getitem__(self, index):
        return tuple(sorted(_TASKS))[index]

    def __len__(self) -> int:
        return len(_TASKS)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(TaskNames)

    def __repr__(self) -> str:
        return repr(tuple(self))


ALL = TaskNames()


def register(name: str) -> Callable[[_Task], _Task]:
    """Returns a decorator that makes a task known by a name.

    From then on `load`, the batch, dm_control's suite, Gymnasium and the explorer know it.

    Args:
        name: Letters, digits and underscores, such as 'push_through_gate'.

    Raises:
        ValueError: if the name is taken or is not an identifier.
    """
    if not isinstance(name, str) or not name.isidentifier():
        raise ValueError(f'The name of a task must be an identifier such as push; got {name!r}.')

    def add(task_class: _Task) -> _Task:
        taken = _TASKS.get(name)
        if taken is not None and not _is_reloaded(taken, task_class):
            raise ValueError(f'The name {name!r} is taken by {taken.__name__}.')
        task_class.name = name
        _TASKS[name] = task_class
        if taken is None:
            for listener in _LISTENERS:
                listener(name)
        return task_class

    return add


def _is_reloaded(one: type, other: type) -> bool:
    """Returns whether two classes are one definition, run twice as a notebook does."""
    return (one.__module__, one.__qualname__) == (other.__module__, other.__qualname__)


def on_register(listener: Callable[[str], None]) -> None:
    """Calls a function with the name of every task: those that there are, and those to come."""
    _LISTENERS.append(listener)
    for name in ALL:
        listener(name)


def task_class(name: str) -> type[GoalTask]:
    """Returns the class of a task.

    Raises:
        ValueError: if there is none of that name; the message lists the valid ones.
    """
    checks.one_of('task', name, ALL)
    return _TASKS[name]


def conventions_of(name: str) -> tuple[str, ...]:
    """Returns the names of the conventions that a task has."""
    return task_class(name).conventions


def published() -> tuple[str, ...]:
    """Returns the names of the tasks that Gymnasium-Robotics has too: those with its convention."""
    return tuple(name for name in ALL if len(conventions_of(name)) > 1)


def default_options(name: str) -> TaskOptions:
    """Returns the options of a task of which none is given: its own default, in `__init__`."""
    default = inspect.signature(task_class(name).__init__).parameters['options'].default
    return default if isinstance(default, TaskOptions) else TaskOptions()


def options(name: str) -> tuple[str, ...]:
    """Returns the names of the options that a task takes: everyone's, and its own."""
    own = set(inspect.signature(task_class(name).__init__).parameters) - {'self', 'options'}
    return tuple(sorted(own | set(NAMES)))


def make(name: str, **task_kwargs) -> GoalTask:
    """Returns a task.

    Args:
        name: One of `ALL`.
        **task_kwargs: Its options; see `TaskOptions`.

    Raises:
        ValueError: if a name or the value of an option is not valid; the message lists what is.
        UnknownOptionError: if the task has no such option; it is a `ValueError` as well.
    """
    valid = options(name)
    unknown = sorted(set(task_kwargs) - set(valid))
    if unknown:
        raise UnknownOptionError(
            f'{name!r} got an unexpected keyword argument {", ".join(map(repr, unknown))}; '
            f'valid are {", ".join(valid)}.'
        )
    common = {key: task_kwargs.pop(key) for key in NAMES if key in task_kwargs}
    return _TASKS[name](dataclasses.replace(default_options(name), **common), **task_kwargs)
