"""The Fetch manipulation tasks as a dm_control Composer suite."""

import importlib.util

from dm_control import suite as _dm_suite

from fetch_composer import suite
from fetch_composer.batch import BatchEnvironment
from fetch_composer.environment import Environment
from fetch_composer.tasks import ALL, compute_reward

__all__ = ('ALL', 'BatchEnvironment', 'Environment', 'compute_reward', 'load', 'suite')

__version__ = '0.1.0'


def load(task_name: str, seed=None, environment_kwargs=None, **task_kwargs) -> Environment:
    """Returns an environment.

    Args:
        task_name: One of `ALL`.
        seed: A non-negative integer, a `numpy.random.RandomState`, or None for entropy.
        environment_kwargs: Options of the environment (see `composer.Environment`).
        **task_kwargs: Options of the task (see `tasks.GoalTask`): `reward_type`,
            `max_episode_steps`, `convention`, ...

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    task_kwargs = {'random': seed, **task_kwargs}
    return suite.load(suite.DOMAIN, task_name, task_kwargs, environment_kwargs)


def _join_dm_control_suite() -> None:
    """Makes `dm_control.suite.load('fetch', ...)` work, and lists the tasks there."""
    if suite.DOMAIN in _dm_suite._DOMAINS:
        return
    _dm_suite._DOMAINS[suite.DOMAIN] = suite
    _dm_suite.TASKS_BY_DOMAIN[suite.DOMAIN] = ALL
    names = tuple((suite.DOMAIN, task_name) for task_name in ALL)
    _dm_suite.ALL_TASKS += names
    _dm_suite.EXTRA += names


_join_dm_control_suite()


# Importing registers the Gymnasium ids, which is what `gymnasium.register_envs` asks for.
if importlib.util.find_spec('gymnasium'):
    from fetch_composer.interfaces import gymnasium_env as _gymnasium_env  # noqa: F401
