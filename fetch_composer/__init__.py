"""The Fetch manipulation tasks as a dm_control Composer suite."""

from fetch_composer import opengl as _opengl  # noqa: F401, I001  Before all that draws.
from fetch_composer import gymnasium_ids as _gymnasium_ids
from fetch_composer import suite
from fetch_composer.batch import BatchEnvironment
from fetch_composer.environment import Environment
from fetch_composer.joining import when_imported as _when_imported
from fetch_composer.tasks import ALL, compute_reward

__all__ = ('ALL', 'BatchEnvironment', 'Environment', 'compute_reward', 'load', 'suite')

__version__ = '0.1.0'


def load(task_name: str, seed=None, environment_kwargs=None, **task_kwargs) -> Environment:
    """Returns an environment.

    Args:
        task_name: One of `ALL`.
        seed: A non-negative integer, a `numpy.random.RandomState`, or None for entropy.
        environment_kwargs: Options of the environment (see `Environment`).
        **task_kwargs: Options of the task (see `tasks.TaskOptions`): `reward_type`,
            `max_episode_steps`, `convention`, ...

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    if seed is not None and 'random' in task_kwargs:
        raise ValueError('The seed is given twice: as seed and as random.')
    task_kwargs = {'random': seed, **task_kwargs}
    return suite.load(suite.DOMAIN, task_name, task_kwargs, environment_kwargs)


# Either is imported only by those who use it: it takes longer than all that is here.
_when_imported('dm_control.suite', suite.join_dm_control_suite)
_when_imported('gymnasium', _gymnasium_ids.register_all)
