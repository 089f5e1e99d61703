"""How much memory a process with so many environments holds."""

import gc
import pathlib
import resource

from benchmarks.workers import protocol, rounds

_NUM_STEPS = 5  # After which everything that a step needs has been allocated.


def _composer_single(count: int):
    import fetch_composer

    envs = [fetch_composer.load('push', seed=i) for i in range(count)]
    for env in envs:
        env.reset()
        for action in rounds.episode_actions(0)[:_NUM_STEPS]:
            env.step(action)
    return envs


def _composer_batch(count: int):
    import fetch_composer

    env = fetch_composer.BatchEnvironment('push', count, seed=0)
    env.reset()
    for actions in rounds.episode_actions(0, count)[:_NUM_STEPS]:
        env.step(actions)
    return env


def _robotics_single(count: int):
    import gymnasium
    import gymnasium_robotics

    gymnasium.register_envs(gymnasium_robotics)
    envs = [gymnasium.make('FetchPush-v4') for _ in range(count)]
    for i, env in enumerate(envs):
        env.reset(seed=i)
        for action in rounds.episode_actions(0)[:_NUM_STEPS]:
            env.step(action)
    return envs


def _envpool_batch(count: int):
    import envpool

    env = envpool.make('FetchPush-v4', 'gymnasium', num_envs=count, seed=0)
    env.reset()
    for actions in rounds.episode_actions(0, count)[:_NUM_STEPS]:
        env.step(actions)
    return env


_KINDS = {
    'composer_single': _composer_single,
    'composer_batch': _composer_batch,
    'robotics_single': _robotics_single,
    'envpool_batch': _envpool_batch,
}


def _resident_bytes() -> int:
    statm = pathlib.Path('/proc/self/statm')
    if statm.exists():
        return int(statm.read_text().split()[1]) * resource.getpagesize()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # Its peak, where there is no /proc.


def build(kind: str, count: int):
    """Returns what measures the resident memory in bytes once each environment has stepped.

    Args:
        kind: One of 'composer_single', 'composer_batch', 'robotics_single', 'envpool_batch'.
        count: How many environments.
    """
    envs = _KINDS[kind](count)

    def measure(keep=envs) -> int:
        del keep  # Alive as long as this function is.
        gc.collect()
        return _resident_bytes()

    return measure


if __name__ == '__main__':
    protocol.serve(build)
