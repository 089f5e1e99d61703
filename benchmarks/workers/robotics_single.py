"""FetchPush-v4 of Gymnasium-Robotics: its control steps."""

import gymnasium
import gymnasium_robotics

from benchmarks.workers import protocol, rounds


def build(num_steps: int, resets: bool = False):
    """Returns what measures one round of so many control steps, and of resets if asked for."""
    gymnasium.register_envs(gymnasium_robotics)
    env = gymnasium.make('FetchPush-v4')

    def start_episode(episode: int):
        env.reset(seed=episode)
        return rounds.episode_actions(episode)

    reset = env.reset if resets else None
    return rounds.Stepping(start_episode, env.step, num_steps, reset=reset)


if __name__ == '__main__':
    protocol.serve(build)
