"""What a dm_env agent relies on, of every task and convention."""

import subprocess
import sys

import numpy as np
import pytest
from absl.testing import absltest
from dm_control import composer
from dm_control import suite as dm_suite
from dm_env import StepType, test_utils

import fetch_composer
from fetch_composer import suite, tasks
from fetch_composer.tasks import rewards
from tests import episodes


def _mixin_test(task_name, convention):
    class Test(test_utils.EnvironmentTestMixin, absltest.TestCase):
        def make_object_under_test(self):
            return fetch_composer.load(task_name, seed=0, convention=convention)

        def make_action_sequence(self):
            yield from episodes.uniform_actions(120)  # Past the end of two episodes.

    Test.__name__ = Test.__qualname__ = f'TestDmEnv_{task_name}_{convention}'
    return Test


for _task_name in fetch_composer.ALL:
    for _convention in tasks.conventions_of(_task_name):
        _test = _mixin_test(_task_name, _convention)
        globals()[_test.__name__] = _test
del _test


def test_dm_controls_suite_lists_the_tasks():
    for task_name in fetch_composer.ALL:
        assert ('fetch', task_name) in dm_suite.ALL_TASKS
        assert task_name in dm_suite.TASKS_BY_DOMAIN['fetch']


_LATER = """
import sys
import fetch_composer
assert 'gymnasium' not in sys.modules and 'dm_control.suite' not in sys.modules
import gymnasium
from dm_control import suite
print(suite.load('fetch', 'reach').reset().observation['observation'].shape)
print(('fetch', 'slide') in suite.ALL_TASKS, 'fetch_composer/FetchPush-v4' in gymnasium.registry)
"""


def test_libraries_that_are_imported_later_know_the_tasks_too():
    """They take longer to import than everything here, and so are left to those who use them."""
    result = subprocess.run([sys.executable, '-c', _LATER], capture_output=True, text=True)
    assert result.stdout == '(10,)\nTrue True\n', result.stderr


def test_all_names_the_tasks():
    assert tasks.published() == ('pick_and_place', 'push', 'reach', 'slide')
    assert {*tasks.published(), 'push_around', 'push_two', 'stack'} <= set(fetch_composer.ALL)
    assert sorted(suite.SUITE) == list(fetch_composer.ALL)


def test_every_door_leads_to_the_same_environment(task_name):
    task_kwargs = {'random': 3, 'reward_type': 'dense'}
    environments = (
        fetch_composer.load(task_name, seed=3, reward_type='dense'),
        suite.load('fetch', task_name, task_kwargs=task_kwargs),
        dm_suite.load('fetch', task_name, task_kwargs=task_kwargs),
        suite.SUITE[task_name](**task_kwargs),
    )
    actions = episodes.uniform_actions(5)
    expected = episodes.run(environments[0], actions)
    for environment in environments:
        assert isinstance(environment, composer.Environment)
    for environment in environments[1:]:
        episodes.assert_same(episodes.run(environment, actions), expected)


def test_actions_are_four_floats_within_one(shared_env):
    spec = shared_env.action_spec()
    assert spec.shape == (4,)
    assert spec.dtype == np.float32
    np.testing.assert_array_equal(spec.minimum, np.full(4, -1))
    np.testing.assert_array_equal(spec.maximum, np.full(4, 1))


def test_observations_are_the_goal_dictionary(shared_env, task_name):
    size = 10 if task_name == 'reach' else 25
    expected = {'observation': (size,), 'achieved_goal': (3,), 'desired_goal': (3,)}
    spec = shared_env.observation_spec()
    assert {name: each.shape for name, each in spec.items()} == expected
    for time_step in episodes.run(shared_env, episodes.uniform_actions(3)):
        assert {k: v.shape for k, v in time_step.observation.items()} == expected
        assert all(v.dtype == np.float64 for v in time_step.observation.values())
        assert all(np.isfinite(v).all() for v in time_step.observation.values())


def test_control_runs_at_25_hz_over_20_substeps(shared_env):
    assert shared_env.control_timestep() == pytest.approx(0.04, abs=1e-12)
    assert shared_env.physics.timestep() == 0.002
    shared_env.reset()
    start = shared_env.physics.time()
    for action in episodes.uniform_actions(10):
        shared_env.step(action)
    assert shared_env.physics.time() - start == pytest.approx(0.4, abs=1e-9)


@pytest.mark.parametrize('max_episode_steps', [1, 50, 100])
def test_an_episode_is_truncated_after_exactly_its_steps(task_name, convention, max_episode_steps):
    env = fetch_composer.load(
        task_name, seed=0, convention=convention, max_episode_steps=max_episode_steps
    )
    for _ in range(2):
        time_steps = episodes.run(env, episodes.uniform_actions(max_episode_steps))
        types = [time_step.step_type for time_step in time_steps]
        assert types == [
            StepType.FIRST,
            *[StepType.MID] * (max_episode_steps - 1),
            StepType.LAST,
        ]
        assert [time_step.discount for time_step in time_steps[1:]] == [1.0] * max_episode_steps


def test_an_episode_lasts_50_steps_by_default(shared_env):
    time_steps = episodes.run(shared_env, episodes.uniform_actions(50))
    assert time_steps[-1].last()
    assert not time_steps[-2].last()


def test_episodes_never_end_without_a_limit(task_name):
    env = fetch_composer.load(task_name, seed=0, max_episode_steps=None)
    assert not any(t.last() for t in episodes.run(env, episodes.uniform_actions(120)))


@pytest.mark.parametrize('reward_type', rewards.REWARD_TYPES)
def test_rewards_follow_from_the_goals(task_name, convention, reward_type):
    env = episodes.shared(task_name, convention=convention, reward_type=reward_type)
    spec = env.reward_spec()
    for time_step in episodes.run(env, episodes.uniform_actions(20))[1:]:
        observation = time_step.observation
        offset = observation['achieved_goal'] - observation['desired_goal']
        distance = np.linalg.norm(offset)
        expected = -distance if reward_type == 'dense' else -float(distance >= 0.05)
        assert time_step.reward == pytest.approx(expected, abs=1e-12)
        spec.validate(time_step.reward)


def test_the_threshold_is_five_centimetres():
    goals = np.zeros((3, 3))
    achieved = np.array([[0.0499999, 0, 0], [0, 0.05, 0], [0, 0, 0.0500001]])
    np.testing.assert_array_equal(fetch_composer.compute_reward(achieved, goals), [0, -1, -1])


def test_compute_reward_counts_in_float64_whatever_it_is_given():
    near, far = np.uint8([[1, 2, 3]]), np.uint8([[3, 2, 1]])
    dense = fetch_composer.compute_reward(near, far, 'dense')
    assert dense.dtype == np.float64
    np.testing.assert_allclose(dense, -np.sqrt(8))


@pytest.mark.parametrize('goal', [(1.0, 2.0), 1.0, np.zeros((3, 2))])
def test_compute_reward_refuses_goals_of_other_sizes(goal):
    with pytest.raises(ValueError, match=r'desired_goal must be of shape \(..., 3\)'):
        fetch_composer.compute_reward(np.zeros(3), goal)


def test_compute_reward_takes_any_batch_shape():
    achieved = np.random.default_rng(0).normal(size=(4, 5, 3))
    goals = np.zeros((4, 5, 3))
    dense = fetch_composer.compute_reward(achieved, goals, 'dense')
    np.testing.assert_allclose(dense, -np.linalg.norm(achieved, axis=-1))
    one_by_one = [fetch_composer.compute_reward(a, np.zeros(3), 'dense') for a in achieved[0]]
    np.testing.assert_array_equal(dense[0], one_by_one)


def test_success_earns_the_sparse_reward(task_name):
    env = fetch_composer.load(task_name, seed=0)
    start = env.reset().observation['achieved_goal']
    env.task.set_next_episode(goal=start + (0.01, 0, 0))
    if task_name != 'reach':
        env.task.set_next_episode(object_position=start[:2], goal=start + (0.01, 0, 0))
    env.reset()
    time_step = env.step(np.zeros(4, np.float32))
    assert time_step.reward == 0
    assert env.task.is_success()


def test_observations_are_not_shared_memory(shared_env):
    time_steps = episodes.run(shared_env, episodes.uniform_actions(4))
    arrays = [value for t in time_steps for value in t.observation.values()]
    for i, one in enumerate(arrays):
        assert not any(np.shares_memory(one, other) for other in arrays[i + 1 :])
    kept = [t.observation['observation'].copy() for t in time_steps]
    time_steps[-1].observation['observation'][:] = np.nan
    assert np.isfinite(shared_env.step(np.zeros(4, np.float32)).observation['observation']).all()
    np.testing.assert_array_equal(time_steps[0].observation['observation'], kept[0])


def test_every_observation_varies_unless_the_fingers_are_rigid(shared_env, task_name, convention):
    time_steps = episodes.run(shared_env, episodes.uniform_actions(50, seed=1))
    if task_name != 'reach':  # Random actions rarely meet the object: seek it.
        time_step = shared_env.reset()
        for _ in range(40):
            goal = time_step.observation['achieved_goal']
            time_step = shared_env.step(episodes.towards(time_step.observation, goal))
            time_steps.append(time_step)
    spread = np.ptp([t.observation['observation'] for t in time_steps], axis=0)
    rigid = np.zeros(len(spread), dtype=bool)
    if convention == 'documented' and task_name != 'pick_and_place':
        rigid[_finger_columns(len(spread))] = True
    assert (spread[~rigid] > 0).all(), np.flatnonzero(~rigid & (spread == 0))


def test_locked_fingers_read_zero_after_every_step(locked_task_name, convention):
    env = episodes.shared(locked_task_name, convention=convention)
    for time_step in episodes.run(env, episodes.uniform_actions(50))[1:]:
        observation = time_step.observation['observation']
        assert np.abs(observation[_finger_columns(len(observation))[:2]]).max() < 1e-4


def test_dense_rewards_have_no_bound_that_is_infinite(task_name):
    env = episodes.shared(task_name, reward_type='dense')
    assert np.isfinite(env.reward_spec().generate_value())


def test_fingers_of_a_locked_gripper_are_observed_closed(locked_task_name):
    env = fetch_composer.load(locked_task_name, seed=0)
    for name in ('finger_positions', 'finger_velocities'):
        env.task.observables[f'fetch/gripper/{name}'].enabled = True
    for time_step in episodes.run(env, episodes.uniform_actions(3)):
        for name in ('finger_positions', 'finger_velocities'):
            np.testing.assert_array_equal(
                time_step.observation[f'fetch/gripper/{name}'], np.zeros(2)
            )


def _finger_columns(size: int) -> list[int]:
    displacement = 3 if size == 10 else 9
    return [displacement, displacement + 1, size - 2, size - 1]


def test_entities_offer_observables_that_are_off_by_default(shared_env):
    enabled = [name for name, each in shared_env.task.observables.items() if each.enabled]
    assert sorted(enabled) == ['achieved_goal', 'desired_goal', 'observation']
    names = set(shared_env.task.observables)
    assert {'fetch/joints_pos', 'fetch/joints_vel', 'fetch/head_camera'} <= names
    assert {'fetch/gripper/tool_center_point', 'fetch/gripper/gripper_camera'} <= names
    assert 'target/position' in names


def test_joint_states_can_be_switched_on(env):
    env.task.observables['fetch/joints_pos'].enabled = True
    env.task.observables['fetch/gripper/tool_center_point'].enabled = True
    for time_step in episodes.run(env, episodes.uniform_actions(3)):
        observation = time_step.observation
        assert observation['fetch/joints_pos'].shape == (7,)
        np.testing.assert_array_equal(
            observation['fetch/gripper/tool_center_point'], observation['observation'][:3]
        )


def test_the_target_turns_green_at_the_goal_on_request():
    env = suite.load('fetch', 'push', task_kwargs={'random': 0}, visualize_reward=True)
    plain = suite.load('fetch', 'push', task_kwargs={'random': 0})
    for each, colour_at_goal in ((env, (0.2, 0.8, 0.2)), (plain, (0.9, 0.1, 0.1))):
        each.task.set_next_episode(object_position=(1.2, 0.7), goal=(1.2, 0.71, 0.4249))
        each.reset()
        assert each.step(np.zeros(4, np.float32)).reward == 0
        rgba = each.physics.named.model.site_rgba['target/target']
        np.testing.assert_allclose(rgba[:3], colour_at_goal, atol=1e-6)
    env.reset()
    env.step(np.zeros(4, np.float32))
    rgba = env.physics.named.model.site_rgba['target/target']
    np.testing.assert_allclose(rgba[:3], (0.9, 0.1, 0.1), atol=1e-6)
