"""Episodes on the native batch, for learning from them and for judging a policy."""

from collections.abc import Callable, Sequence

import numpy as np

from fetch_composer import batch as batch_lib
from fetch_composer.learning import networks
from fetch_composer.learning.replay import Episodes


def run_episodes(
    batch: batch_lib.BatchEnvironment,
    seeds: Sequence[int],
    steps: int,
    act: Callable[[np.ndarray, np.ndarray], np.ndarray],
    begin: Callable[[np.ndarray], None] = lambda observation: None,
) -> Episodes:
    """Runs one episode in each environment.

    Args:
        batch: The environments.
        seeds: Seed of each environment.
        steps: Control steps of an episode.
        act: Returns actions for observations and goals.
        begin: Is called with the first observations.
    """
    batch.seed(seeds)
    observed = batch.reset().observation
    goals = observed['desired_goal'].astype(np.float32)
    size = observed['observation'].shape[-1]
    observations = np.empty((batch.num_envs, steps + 1, size), np.float32)
    actions = np.empty((batch.num_envs, steps, networks.ACTION_SIZE), np.float32)
    observations[:, 0] = observed['observation']
    begin(observations[:, 0])
    for i in range(steps):
        actions[:, i] = act(observations[:, i], goals)
        observations[:, i + 1] = batch.step(actions[:, i]).observation['observation']
    return Episodes(observations, goals, actions)


def evaluate(
    batch: batch_lib.BatchEnvironment,
    act: Callable[[np.ndarray, np.ndarray], np.ndarray],
    seeds: Sequence[int],
    steps: int,
) -> np.ndarray:
    """Returns whether the episode of each seed ends at its goal."""
    results: list[bool] = []
    for i in range(0, len(seeds), batch.num_envs):
        part = list(seeds[i : i + batch.num_envs])
        missing = batch.num_envs - len(part)
        episodes = run_episodes(batch, part + part[:1] * missing, steps, act)
        results.extend(episodes.is_success()[: len(part)])
    return np.array(results)
