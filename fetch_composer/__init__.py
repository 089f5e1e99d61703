"""The Fetch manipulation tasks as a dm_control Composer suite."""

from dm_control import suite as _dm_suite

from fetch_composer import suite
from fetch_composer.suite import ALL
from fetch_composer.tasks.rewards import compute_reward

__all__ = ('ALL', 'compute_reward', 'load', 'suite')


def load(task_name: str, seed=None, environment_kwargs=None, **task_kwargs):
    """Returns an environment.

    Args:
        task_name: One of `ALL`.
        seed: A non-negative integer, a `numpy.random.RandomState`, or None.
        environment_kwargs: Options of `composer.Environment`.
        **task_kwargs: Options of the task: `reward_type`, `max_episode_steps`, `convention`, ...

    Raises:
        ValueError: if a name or an option is not valid; the message lists those that are.
    """
    task_kwargs = {'random': seed, **task_kwargs}
    return suite.load(suite.DOMAIN, task_name, task_kwargs, environment_kwargs)


_dm_suite._DOMAINS.setdefault(suite.DOMAIN, suite)
