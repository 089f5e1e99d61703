"""FetchPush-v4 of EnvPool, every environment in every step."""

import envpool

from benchmarks.workers import protocol, rounds


def build(num_steps: int, num_envs: int, num_threads: int, resets: bool = False):
    """Returns what measures one round.

    Args:
        num_steps: Control steps of the whole batch in a round.
        num_envs: How many environments.
        num_threads: How many threads share them.
        resets: Whether the resets between steps are timed, too.
    """
    env = envpool.make(
        'FetchPush-v4', 'gymnasium', num_envs=num_envs, num_threads=num_threads, seed=0
    )

    def start_episode(episode: int):
        env.reset()
        return rounds.episode_actions(episode, num_envs)

    reset = env.reset if resets else None
    return rounds.Stepping(start_episode, env.step, num_steps, num_envs, reset)


if __name__ == '__main__':
    protocol.serve(build)
