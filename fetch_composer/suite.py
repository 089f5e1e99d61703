"""The `fetch` domain: its tasks by name, loaded as dm_control's own suite loads them."""

import functools
import sys

from dm_control.utils import containers

from fetch_composer import tasks
from fetch_composer.environment import Environment

DOMAIN = 'fetch'
SUITE = containers.TaggedTasks()


def _make(task_name: str, random=None, environment_kwargs=None, **task_kwargs) -> Environment:
    environment_kwargs = dict(environment_kwargs or {})
    if 'random_state' in environment_kwargs and random is not None:
        raise ValueError(
            "The seed is given twice: as the task's `random` (or `seed`), and as `random_state` in "
            'environment_kwargs. Give the first alone.'
        )
    environment_kwargs.setdefault('random_state', random)
    return Environment(tasks.make(task_name, **task_kwargs), **environment_kwargs)


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
        task_kwargs: Options of the task (see `tasks.TaskOptions`), and `random`: a seed or a
            `numpy.random.RandomState`.
        environment_kwargs: Options of the environment (see `Environment`), such as
            `flat_observation`.
        visualize_reward: Whether the target changes colour while the goal is achieved.

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    if domain_name != DOMAIN:
        raise ValueError(f'Unknown domain {domain_name!r}; valid is {DOMAIN!r}.')
    env = _make(task_name, environment_kwargs=environment_kwargs, **(task_kwargs or {}))
    env.task.visualize_reward = visualize_reward
    return env


def _add(task_name: str) -> None:
    factory = functools.partial(_make, task_name)
    functools.update_wrapper(factory, _make)
    factory.__name__ = task_name  # type: ignore[attr-defined]
    SUITE.add('goal')(factory)


tasks.on_register(_add)


def join_dm_control_suite() -> None:
    """Makes `dm_control.suite.load('fetch', ...)` work, and lists the tasks there.

    dm_control's suite imports every domain that it has, and so must have been imported before.
    """
    from dm_control import suite as dm_suite

    def list_there(task_name: str) -> None:
        entry = (DOMAIN, task_name)
        if entry not in dm_suite.ALL_TASKS:
            dm_suite.TASKS_BY_DOMAIN[DOMAIN] = tuple(tasks.ALL)
            dm_suite.ALL_TASKS += (entry,)
            dm_suite.EXTRA += (entry,)

    dm_suite._DOMAINS.setdefault(DOMAIN, sys.modules[__name__])
    tasks.on_register(list_there)
