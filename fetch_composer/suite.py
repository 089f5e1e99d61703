"""The `fetch` domain: its tasks by name, loaded as dm_control's own suite loads them."""

import inspect

from dm_control.utils import containers

from fetch_composer import tasks
from fetch_composer.environment import Environment

DOMAIN = 'fetch'
SUITE = containers.TaggedTasks()


def _task_options(task_class) -> tuple[str, ...]:
    """Returns the names of the options that a task takes."""
    fixed_by_task = {'self', 'name', 'workspace', 'block', 'locked_gripper', 'options'}
    names = {
        name
        for cls in (task_class, tasks.GoalTask)
        for name in inspect.signature(cls.__init__).parameters
    }
    return tuple(sorted(names - fixed_by_task))


def _make(task_class, random, environment_kwargs, task_kwargs) -> Environment:
    valid = _task_options(task_class)
    unknown = sorted(set(task_kwargs) - set(valid))
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(repr, unknown))}; valid are '
            f'{", ".join((*valid, "random", "environment_kwargs"))}.'
        )
    task = task_class(**task_kwargs)
    return Environment(task, random_state=random, **(environment_kwargs or {}))


@SUITE.add('push')
def push(random=None, environment_kwargs=None, **task_kwargs) -> Environment:
    """Returns the Push task."""
    return _make(tasks.Push, random, environment_kwargs, task_kwargs)


ALL = tuple(sorted(SUITE))


def load(
    domain_name: str,
    task_name: str,
    task_kwargs=None,
    environment_kwargs=None,
    visualize_reward: bool = False,
) -> Environment:
    """Returns an environment, as `dm_control.suite.load` does.

    Args:
        domain_name: 'fetch'.
        task_name: One of `ALL`.
        task_kwargs: Options of the task, and `random`: a seed or a `RandomState`.
        environment_kwargs: Options of the environment.
        visualize_reward: Whether the target changes colour while the goal is achieved.

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    if domain_name != DOMAIN:
        raise ValueError(f'Unknown domain {domain_name!r}; valid is {DOMAIN!r}.')
    if task_name not in SUITE:
        raise ValueError(f'Unknown task {task_name!r}; valid are {", ".join(ALL)}.')
    env = SUITE[task_name](environment_kwargs=environment_kwargs, **(task_kwargs or {}))
    env.task.visualize_reward = visualize_reward
    return env
