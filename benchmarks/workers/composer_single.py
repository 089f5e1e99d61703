"""A single Push of ours, through either interface: its control steps or its resets."""

import fetch_composer
from benchmarks.workers import protocol, rounds

_VERSIONS = {'documented': 'v2', 'gymnasium_robotics': 'v4'}


def _through_dm_env(convention: str):
    env = fetch_composer.load('push', seed=0, convention=convention)

    def start_episode(episode: int):
        env.seed(episode)
        env.reset()
        return rounds.episode_actions(episode)

    return start_episode, env.step, env.reset


def _through_gymnasium(convention: str):
    import gymnasium

    env = gymnasium.make(f'fetch_composer/FetchPush-{_VERSIONS[convention]}')

    def start_episode(episode: int):
        env.reset(seed=episode)
        return rounds.episode_actions(episode)

    return start_episode, env.step, env.reset


_INTERFACES = {'dm_env': _through_dm_env, 'gymnasium': _through_gymnasium}


def build(num_steps: int, convention: str, interface: str = 'dm_env', operation: str = 'step'):
    """Returns what measures one round.

    Args:
        num_steps: Control steps, or resets, in a round.
        convention: 'documented' or 'gymnasium_robotics'.
        interface: 'dm_env' or 'gymnasium'.
        operation: 'step' or 'reset'.
    """
    start_episode, step, reset = _INTERFACES[interface](convention)
    if operation == 'reset':
        start_episode(0)
        return rounds.Repeating(reset, num_steps)
    return rounds.Stepping(start_episode, step, num_steps)


if __name__ == '__main__':
    protocol.serve(build)
