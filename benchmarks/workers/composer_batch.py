"""A batch of Push of ours."""

import fetch_composer
from benchmarks.workers import protocol, rounds


def build(
    num_steps: int,
    num_envs: int,
    num_threads: int,
    convention: str = 'documented',
    resets: bool = False,
):
    """Returns what measures one round.

    Args:
        num_steps: Control steps of the whole batch in a round.
        num_envs: How many environments.
        num_threads: How many threads share them.
        convention: 'documented' or 'gymnasium_robotics'.
        resets: Whether the resets between steps are timed, too.
    """
    env = fetch_composer.BatchEnvironment('push', num_envs, num_threads, convention=convention)

    def start_episode(episode: int):
        env.seed(episode * num_envs)
        env.reset()
        return rounds.episode_actions(episode, num_envs)

    reset = env.reset if resets else None
    return rounds.Stepping(start_episode, env.step, num_steps, num_envs, reset)


if __name__ == '__main__':
    protocol.serve(build)
