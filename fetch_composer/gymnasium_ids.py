"""The ids under which Gymnasium knows the tasks.

They are registered by the names of their entry points, so that the adapters are imported only
when an environment is made.
"""

from fetch_composer import tasks

NAMESPACE = 'fetch_composer'

# The versions that Gymnasium-Robotics gave to its page and its code; other tasks are their own.
_VERSIONS = {'documented': 'v2', 'gymnasium_robotics': 'v4'}
_OWN_VERSION = 'v0'
_REWARD_SUFFIXES = {'sparse': '', 'dense': 'Dense'}

_ENTRY_POINT = 'fetch_composer.interfaces.gymnasium_env:FetchEnv'
_VECTOR_ENTRY_POINT = 'fetch_composer.interfaces.gymnasium_vector:FetchVectorEnv'


def env_id(task: str, convention: str = 'documented', reward_type: str = 'sparse') -> str:
    """Returns the id under which Gymnasium knows a task."""
    camel_case = ''.join(word.capitalize() for word in task.split('_'))
    version = _VERSIONS[convention] if task in tasks.published() else _OWN_VERSION
    suffix = _REWARD_SUFFIXES[reward_type]
    return f'{NAMESPACE}/Fetch{camel_case}{suffix}-{version}'


def register_all() -> None:
    """Registers every task with Gymnasium, those to come included."""
    import gymnasium

    def register(task: str) -> None:
        for convention in tasks.conventions_of(task):
            for reward_type in _REWARD_SUFFIXES:
                gymnasium.register(
                    id=env_id(task, convention, reward_type),
                    entry_point=_ENTRY_POINT,
                    vector_entry_point=_VECTOR_ENTRY_POINT,
                    max_episode_steps=tasks.default_options(task).max_episode_steps,
                    kwargs={'task': task, 'reward_type': reward_type, 'convention': convention},
                )

    tasks.on_register(register)
