"""The `fetch` domain: its tasks by name, loaded as dm_control's own suite loads them."""

import functools

from dm_control.utils import containers

from fetch_composer import tasks
from fetch_composer.environment import Environment

DOMAIN = 'fetch'
SUITE = containers.TaggedTasks()


def _make(task_name: str, random=None, environment_kwargs=None, **task_kwargs) -> Environment:
    task = tasks.make(task_name, **task_kwargs)
    return Environment(task, random_state=random, **(environment_kwargs or {}))


for _task_name in tasks.ALL:
    _factory = functools.partial(_make, _task_name)
    functools.update_wrapper(_factory, _make)
    _factory.__name__ = _task_name  # type: ignore[attr-defined]
    SUITE.add('goal')(_factory)


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
        task_name: One of `fetch_composer.ALL`.
        task_kwargs: Options of the task (see `tasks.GoalTask`), and `random`: a seed or a
            `numpy.random.RandomState`.
        environment_kwargs: Options of the environment (see `composer.Environment`).
        visualize_reward: Whether the target changes colour while the goal is achieved.

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    if domain_name != DOMAIN:
        raise ValueError(f'Unknown domain {domain_name!r}; valid is {DOMAIN!r}.')
    env = _make(task_name, environment_kwargs=environment_kwargs, **(task_kwargs or {}))
    env.task.visualize_reward = visualize_reward
    return env
