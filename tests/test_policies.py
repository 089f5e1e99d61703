"""Policies by name, and how well the experts do."""

import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies, tasks
from tests import episodes

_EXPERT_EPISODES = 50
_CONVENTIONS = ('documented', 'gymnasium_robotics')


def _is_success(env, policy, seed):
    env.seed(seed)
    policy.reset()
    time_step = env.reset()
    while not time_step.last():
        time_step = env.step(policy(time_step.observation))
    return env.task.is_success()


@pytest.fixture(scope='module')
def env():
    env = fetch_composer.load('push', seed=0)
    yield env
    env.close()


@pytest.mark.parametrize('convention', _CONVENTIONS)
def test_push_expert_is_at_the_goal_at_the_last_step(convention):
    env = fetch_composer.load('push', convention=convention)
    expert = policies.load('expert', env)
    reached = [_is_success(env, expert, seed) for seed in range(20_000, 20_000 + _EXPERT_EPISODES)]
    assert np.mean(reached) >= 0.95


@pytest.mark.parametrize('convention', _CONVENTIONS)
def test_push_expert_leaves_a_block_alone_that_starts_at_the_goal(convention):
    env = fetch_composer.load('push', seed=0, convention=convention)
    place = (1.25, 0.85)
    env.task.set_next_episode(object_position=place, goal=(*place, 0.4249))
    expert = policies.load('expert', env)
    time_step = env.reset()
    while not time_step.last():
        time_step = env.step(expert(time_step.observation))
    np.testing.assert_allclose(time_step.observation['achieved_goal'][:2], place, atol=1e-3)


@pytest.mark.parametrize('name', [name for name in policies.ALL if name != 'trained'])
def test_every_task_has_each_policy_whose_actions_fit_and_leave_the_observation_alone(
    task_name, name
):
    env = episodes.shared(task_name)
    policy = policies.load(name, env, seed=0)
    policy.reset()
    observation = env.reset().observation
    before = {key: value.copy() for key, value in observation.items()}
    env.action_spec().validate(policy(observation))
    for key, value in before.items():
        np.testing.assert_array_equal(observation[key], value)


def test_random_policy_repeats_with_its_seed(env):
    def draw(seed):
        policy = policies.load('random', env, seed=seed)
        return np.stack([policy({}) for _ in range(20)])

    np.testing.assert_array_equal(draw(3), draw(3))
    assert not np.array_equal(draw(3), draw(4))
    assert not np.array_equal(draw(None), draw(None))


def test_random_policy_covers_the_range(env):
    policy = policies.load('random', env, seed=0)
    actions = np.stack([policy({}) for _ in range(2000)])
    np.testing.assert_allclose(actions.min(axis=0), -1, atol=0.01)
    np.testing.assert_allclose(actions.max(axis=0), 1, atol=0.01)
    np.testing.assert_allclose(actions.mean(axis=0), 0, atol=0.06)


def test_random_policy_does_not_repeat_the_draws_of_an_environment_with_its_seed(env):
    action = policies.load('random', env, seed=5)({})
    same_stream = np.random.default_rng(5).uniform(-1, 1, size=4).astype(np.float32)
    assert not np.allclose(action, same_stream)


def test_random_policy_leaves_the_generators_of_others_alone(env):
    env.seed(1)
    expected = env.reset().observation['desired_goal']
    env.seed(1)
    np.random.seed(0)
    before = np.random.get_state()[1].copy()
    policies.load('random', env, seed=1)({})
    np.testing.assert_array_equal(np.random.get_state()[1], before)
    np.testing.assert_array_equal(env.reset().observation['desired_goal'], expected)


def test_zero_policy_asks_for_no_motion(env):
    np.testing.assert_array_equal(policies.load('zero', env)({}), np.zeros(4, np.float32))


def test_unknown_policy_is_refused_with_the_valid_names(env):
    with pytest.raises(ValueError, match="Unknown policy 'exprt'; valid are expert, random, zero"):
        policies.load('exprt', env)


def test_a_task_of_ones_own_has_no_expert():
    class Shove(tasks.Push):
        name = 'shove'

    env = fetch_composer.Environment(Shove(), random_state=0)
    with pytest.raises(ValueError, match=r"no expert for the task 'shove'.*push"):
        policies.load('expert', env)
