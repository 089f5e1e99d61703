"""Exploring episodes, for tests of what the learner does while it explores."""

import dataclasses

import numpy as np

from fetch_composer import BatchEnvironment
from fetch_composer.learning import exploration, rollout, settings


def explore(task, convention, policy, num_envs, steps=50, relay=None, falling=0.0, **changes):
    """Returns an exploring episode of each environment, whose actions have no noise by default.

    `falling` is how much of its fall the noise has behind it; other names are settings.
    """
    quiet = {'noise': 0.0, 'uniform_share': 0.0}
    chosen = dataclasses.replace(settings.for_task(task), **quiet | changes)
    explorer = exploration.Explorer(chosen, np.random.default_rng(0), relay)
    with BatchEnvironment(task, num_envs, convention=convention) as batch:
        return rollout.run_episodes(
            batch,
            range(num_envs),
            steps,
            lambda observation, goal: explorer.act(policy, observation, goal),
            lambda observation: explorer.begin(observation, falling),
        )
