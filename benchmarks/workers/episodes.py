"""Episodes of Push as the explorer runs them, on this process's threads or over Ray."""

import atexit
import contextlib
import time

from benchmarks.workers import protocol
from fetch_composer.explorer.episodes import batch_rollout


def build(num_episodes: int, num_envs: int, over_ray: bool):
    """Returns what measures one round, in seconds for each episode.

    Args:
        num_episodes: Episodes in a round.
        num_envs: How many run at a time, or in a task of Ray.
        over_ray: Whether they are spread over a Ray cluster of this machine.
    """
    options = batch_rollout.EpisodeOptions('push', 'expert')
    stack = contextlib.ExitStack()
    atexit.register(stack.close)
    if over_ray:
        from fetch_composer.explorer.episodes import ray_rollout

        rollouts = stack.enter_context(ray_rollout.cluster('local'))
    else:
        rollouts = batch_rollout.BatchRollout  # type: ignore[assignment]
    rollout = stack.enter_context(rollouts(options, num_envs))

    def measure() -> float:
        begin = time.perf_counter()
        finished = sum(len(episodes) for episodes in rollout.run(range(num_episodes)))
        assert finished == num_episodes
        return (time.perf_counter() - begin) / num_episodes

    return measure


if __name__ == '__main__':
    protocol.serve(build)
