"""`gymnasium_robotics` against recorded episodes of Gymnasium-Robotics, on live physics."""

import pathlib

import numpy as np
import pytest

import fetch_composer
from tests import episodes

_DATA = pathlib.Path(__file__).parent / 'data'


@pytest.fixture
def recorded(task_name):
    with np.load(_DATA / f'trajectories_{task_name}.npz') as data:
        return dict(data)


def _replay(task_name, recorded, episode):
    seed = int(recorded['seed'][episode])
    env = episodes.shared(task_name, seed, convention='gymnasium_robotics')
    return episodes.run(env, recorded['actions'][episode])


def test_a_seed_starts_where_it_starts_in_gymnasium_robotics(task_name, recorded):
    for episode in range(len(recorded['seed'])):
        seed = int(recorded['seed'][episode])
        env = fetch_composer.load(task_name, seed=seed, convention='gymnasium_robotics')
        start = env.reset().observation
        for name in ('observation', 'achieved_goal', 'desired_goal'):
            np.testing.assert_allclose(start[name], recorded[name][episode, 0], atol=1e-12)


def test_uniform_actions_lead_where_they_lead_in_gymnasium_robotics(task_name, recorded):
    uniform = np.flatnonzero(recorded['seed'] % 2 == 0)
    errors = []
    for episode in uniform:
        time_steps = _replay(task_name, recorded, episode)
        places = np.array([t.observation['observation'][:6] for t in time_steps])
        error = np.abs(places - recorded['observation'][episode, :, :6])
        errors.append((error[:, :3].max(), error[:, 3:].max()))
        rewards = [t.reward for t in time_steps[1:]]
        np.testing.assert_array_equal(rewards, recorded['reward'][episode])
    gripper, block = np.transpose(errors)
    assert gripper.max() < 1e-9
    # A puck that is touched ends as far away if its arm starts 1e-15 rad aside.
    assert (np.median(block) if task_name == 'slide' else block.max()) < 1e-9


def test_an_arm_that_touches_its_head_goes_where_it_goes_in_gymnasium_robotics():
    with np.load(_DATA / 'head_touched_reach.npz') as data:
        recorded = dict(data)
    time_steps = _replay('reach', recorded, 0)
    grip = np.array([t.observation['observation'][:3] for t in time_steps])
    assert np.abs(grip - recorded['gripper'][0]).max() < 1e-4  # 8e-3 without the touch.


def test_the_joints_are_those_of_gymnasium_robotics(task_name, recorded):
    env = fetch_composer.load(task_name, seed=0, convention='gymnasium_robotics')
    model = env.physics.model
    assert (model.nq, model.nv) == (
        recorded['initial_qpos'].shape[1],
        recorded['initial_qvel'].shape[1],
    )


def test_seeking_actions_lead_where_they_lead_in_gymnasium_robotics(task_name, recorded):
    """A quantile: a difference of 1e-6 rad in one joint moves its own block by centimetres."""
    seeking = np.flatnonzero(recorded['seed'] % 2 == 1)
    errors, equal_rewards = [], []
    for episode in seeking:
        time_steps = _replay(task_name, recorded, episode)
        achieved = np.array([t.observation['achieved_goal'] for t in time_steps])
        errors.append(np.abs(achieved - recorded['achieved_goal'][episode]).max())
        rewards = np.array([t.reward for t in time_steps[1:]])
        equal_rewards.append((rewards == recorded['reward'][episode]).mean())
    limit = 5e-2 if task_name == 'slide' else 1e-6  # The puck is chaotic.
    assert np.median(errors) < limit
    assert np.median(equal_rewards) > 0.995
