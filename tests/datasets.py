"""How tests write datasets, and go back into the environment from what is in them."""

import dataclasses
import pathlib

import numpy as np

from fetch_composer.explorer.datasets import contents, formats
from fetch_composer.explorer.episodes import batch_rollout, provenance
from fetch_composer.tasks import TaskOptions
from tests import episodes as acting

STEPS = 12
SEEDS = (11, 5, 7)
_TOLERANCE = 1e-9


def options(task='push', policy='random', **task_options):
    """Returns what episodes are run with."""
    task_options = TaskOptions(**{'max_episode_steps': STEPS, **task_options})
    return batch_rollout.EpisodeOptions(task, policy, task_options)


def save(target, episode_options, seeds=SEEDS, folder='.', **changes):
    """Writes the episodes of some seeds as a dataset, and returns them."""
    episodes = batch_rollout.run_episodes(episode_options, seeds)
    about = {'versions': provenance.versions(), 'run': 'of a test'}
    made_of = contents.Contents(episode_options, episodes, about, pathlib.Path(folder), **changes)
    dataset = formats.dataset(target)
    dataset.prepare()
    dataset.save(made_of)
    dataset.finish()
    return episodes


def assert_leads_back(episode_options, seed, actions, observations, physics, gripper_pose):
    """Asserts that an episode is there again: from its seed, and from the state of any step.

    Args:
        episode_options: What it was run with.
        seed: Its seed.
        actions: (T, 4) its actions.
        observations: (T or T + 1, n) its observations.
        physics: (T or T + 1, ...) its states.
        gripper_pose: (T or T + 1, 7) their further part.
    """
    env = acting.shared(episode_options.task, seed, **episode_options.task_kwargs)
    time_step = env.reset()
    first = env.get_state()
    states = [
        dataclasses.replace(first, physics=one, gripper_pose=other, steps_taken=step)
        for step, (one, other) in enumerate(zip(physics, gripper_pose, strict=True))
    ]
    for step, observation in enumerate(observations):
        _assert_close(time_step.observation['observation'], observation)
        _assert_close(env.get_state().physics, physics[step])
        if step < len(actions):
            time_step = env.step(actions[step])
    for step in range(len(observations) - 1):
        env.set_state(states[step])
        _assert_close(env.step(actions[step]).observation['observation'], observations[step + 1])


def _assert_close(value, expected):
    np.testing.assert_allclose(value, expected, rtol=0, atol=_TOLERANCE)
