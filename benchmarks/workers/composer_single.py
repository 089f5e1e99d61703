"""A single Push of ours, through either interface: its control steps, resets and states."""

import functools

import fetch_composer
from benchmarks.workers import protocol, rounds

_VERSIONS = {'documented': 'v2', 'gymnasium_robotics': 'v4'}


def _through_dm_env(convention: str):
    env = fetch_composer.load('push', seed=0, convention=convention)

    def start_episode(episode: int):
        env.seed(episode)
        env.reset()
        return rounds.episode_actions(episode)

    return start_episode, env


def _through_gymnasium(convention: str):
    import gymnasium

    env = gymnasium.make(f'fetch_composer/FetchPush-{_VERSIONS[convention]}')

    def start_episode(episode: int):
        env.reset(seed=episode)
        return rounds.episode_actions(episode)

    return start_episode, env


_INTERFACES = {'dm_env': _through_dm_env, 'gymnasium': _through_gymnasium}


def build(num_steps: int, convention: str, interface: str = 'dm_env', operation: str = 'step'):
    """Returns what measures one round.

    Args:
        num_steps: Control steps, or calls of another operation, in a round.
        convention: 'documented' or 'gymnasium_robotics'.
        interface: 'dm_env' or 'gymnasium'.
        operation: 'step', 'reset', 'get_state' or 'set_state'.
    """
    start_episode, env = _INTERFACES[interface](convention)
    if operation == 'step':
        return rounds.Stepping(start_episode, env.step, num_steps)
    start_episode(0)
    call = getattr(env, operation)
    if operation == 'set_state':
        call = functools.partial(call, env.get_state())
    return rounds.Repeating(call, num_steps)


if __name__ == '__main__':
    protocol.serve(build)
