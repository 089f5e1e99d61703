"""The native batch against as many single environments."""

import dataclasses
import subprocess
import sys

import dm_env
import numpy as np
import pytest
from dm_control.rl import control

import fetch_composer
from fetch_composer import tasks
from tests import episodes

_NUM_ENVS = 3


def _assert_rows_equal(batched, singles) -> None:
    for i, single in enumerate(singles):
        assert batched.step_type[i] == single.step_type
        assert batched.reward[i] == (single.reward or 0.0)
        assert batched.discount[i] == (1.0 if single.discount is None else single.discount)
        assert set(batched.observation) == set(single.observation)
        for name, value in single.observation.items():
            np.testing.assert_array_equal(batched.observation[name][i], value, err_msg=name)


@pytest.mark.parametrize('num_envs', [1, _NUM_ENVS])
@pytest.mark.parametrize('reward_type', ['sparse', 'dense'])
def test_environment_i_is_the_single_environment_of_seed_plus_i(
    task_name, convention, reward_type, num_envs
):
    """Over three episodes, resets included, while some of them push their object."""
    options = {'convention': convention, 'reward_type': reward_type}
    batch = fetch_composer.BatchEnvironment(task_name, num_envs, seed=5, **options)
    time_steps = [batch.reset()]
    all_actions = episodes.uniform_actions(120, batch_shape=(num_envs,))
    for step, actions in enumerate(all_actions):
        if step % 50 > 10:
            first = {name: rows[0] for name, rows in time_steps[-1].observation.items()}
            actions[0] = episodes.push_through(first)
        time_steps.append(batch.step(actions))
    singles = []
    for i in range(num_envs):
        single = episodes.shared(task_name, 5 + i, **options)
        singles.append(episodes.run(single, all_actions[:, i]))
    for time_step, *others in zip(time_steps, *singles, strict=True):
        _assert_rows_equal(time_step, others)


def test_environments_that_end_at_different_times_start_anew_each_on_its_own():
    batch = fetch_composer.BatchEnvironment('push', _NUM_ENVS, seed=0, max_episode_steps=4)
    batch.reset()
    # As though this environment were two steps ahead.
    ahead = dataclasses.replace(batch.get_states([1])[0], steps_taken=2)
    batch.set_states([ahead], [1])
    types = []
    for actions in episodes.uniform_actions(7, batch_shape=(_NUM_ENVS,)):
        time_step = batch.step(actions)
        types.append([dm_env.StepType(t).name for t in time_step.step_type])
        first = time_step.step_type == dm_env.StepType.FIRST
        np.testing.assert_array_equal(time_step.observation['observation'][first, 14:], 0)
    assert [t[0] for t in types] == ['MID', 'MID', 'MID', 'LAST', 'FIRST', 'MID', 'MID']
    assert [t[1] for t in types] == ['MID', 'LAST', 'FIRST', 'MID', 'MID', 'MID', 'LAST']


def test_threads_change_nothing(task_name):
    actions = episodes.uniform_actions(60, batch_shape=(4,))

    def run(num_threads):
        batch = fetch_composer.BatchEnvironment(task_name, 4, num_threads, seed=0)
        return episodes.run(batch, actions)

    for one, other in zip(run(1), run(4), strict=True):
        for name in one.observation:
            np.testing.assert_array_equal(one.observation[name], other.observation[name])


def test_specs_describe_the_time_steps(task_name, convention):
    batch = fetch_composer.BatchEnvironment(task_name, 2, seed=0, convention=convention)
    assert batch.action_spec().shape == (2, 4)
    batch.reset()
    time_step = batch.step(np.zeros((2, 4), np.float32))
    for name, spec in batch.observation_spec().items():
        spec.validate(time_step.observation[name])
    batch.reward_spec().validate(time_step.reward)
    batch.discount_spec().validate(time_step.discount)
    assert batch.num_envs == 2


def test_observations_are_not_shared_memory(task_name):
    batch = fetch_composer.BatchEnvironment(task_name, 2, seed=0)
    first = batch.reset()
    kept = {name: value.copy() for name, value in first.observation.items()}
    second = batch.step(np.ones((2, 4), np.float32))
    for name, value in first.observation.items():
        np.testing.assert_array_equal(value, kept[name])
        assert not np.shares_memory(value, second.observation[name])


def test_given_places_may_be_one_for_all_or_one_for_each():
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0)
    goals = np.array([[1.2, 0.7, 0.425], [1.3, 0.8, 0.425]])
    observation = batch.reset(object_position=(1.25, 0.6), goal=goals).observation
    np.testing.assert_allclose(observation['achieved_goal'][:, :2], [(1.25, 0.6)] * 2)
    np.testing.assert_array_equal(observation['desired_goal'], goals)


def test_a_bad_row_is_named_and_no_environment_moves():
    batch = fetch_composer.BatchEnvironment('push', 3, seed=0)
    before = batch.reset().observation['observation']
    actions = np.zeros((3, 4), np.float32)
    actions[1, 2] = np.nan
    with pytest.raises(ValueError, match=r'\[1\]'):
        batch.step(actions)
    with pytest.raises(ValueError, match=r'\(3, 4\)'):
        batch.step(np.zeros((2, 4)))
    after = batch.step(np.zeros((3, 4), np.float32)).observation['observation']
    np.testing.assert_allclose(after[:, :6], before[:, :6], atol=1e-5)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'num_envs': 0}, 'num_envs must be a positive integer'),
        ({'num_envs': 2.5}, 'num_envs must be a positive integer'),
        ({'num_envs': 2, 'num_threads': 0}, 'num_threads must be a positive integer'),
        ({'num_envs': 2, 'num_threads': 3}, r'num_threads \(3\) must not exceed num_envs \(2\)'),
        ({'num_envs': 2, 'seed': [1, 2, 3]}, '2 seeds are needed'),
        ({'num_envs': 2, 'unknown': 1}, 'valid are .*convention'),
    ],
)
def test_arguments_that_make_no_sense_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        fetch_composer.BatchEnvironment('push', **arguments)


def test_divergence_names_the_environment():
    batch = fetch_composer.BatchEnvironment('push', 3, seed=0)
    batch.reset()
    batch._simulations._sims.bind('qvel')[2] = 1e12
    singles = [fetch_composer.load('push', seed=i) for i in range(3)]
    for single in singles:
        single.reset()
    actions = episodes.uniform_actions(5, batch_shape=(3,))
    with pytest.raises(control.PhysicsError, match=r'\[2\]'):
        batch.step(actions[0])
    for single, action in zip(singles[:2], actions[0], strict=False):
        single.step(action)
    # The others have moved on, and it starts its next episode.
    expected = [singles[0].step(actions[1, 0]), singles[1].step(actions[1, 1]), singles[2].reset()]
    _assert_rows_equal(batch.step(actions[1]), expected)
    for action in actions[2:]:
        expected = [single.step(a) for single, a in zip(singles, action, strict=True)]
        _assert_rows_equal(batch.step(action), expected)


def test_it_says_what_it_is_a_batch_of():
    batch = fetch_composer.BatchEnvironment('slide', 2, convention='gymnasium_robotics')
    assert (batch.task_name, batch.convention) == ('slide', 'gymnasium_robotics')
    assert batch.options == tasks.TaskOptions(convention='gymnasium_robotics')


@pytest.mark.parametrize('ids', [[2, 0], np.array([True, False, True])])
def test_some_environments_start_anew_and_the_others_go_on(task_name, ids):
    batch = fetch_composer.BatchEnvironment(task_name, 3, seed=0)
    singles = [episodes.shared(task_name, i, number=i) for i in range(3)]
    batch.reset()
    for single in singles:
        single.reset()
    actions = episodes.uniform_actions(6, batch_shape=(3,))
    for action in actions[:3]:
        before = batch.step(action)
        expected = [single.step(a) for single, a in zip(singles, action, strict=True)]
    after = batch.reset(ids)
    np.testing.assert_array_equal(after.step_type, [0, 1, 0])
    assert (after.reward == 0).all()
    for name, value in before.observation.items():
        np.testing.assert_array_equal(after.observation[name][1], value[1])
    expected = [singles[0].reset(), expected[1], singles[2].reset()]
    for action in actions[3:]:
        after = batch.step(action)
        expected = [single.step(a) for single, a in zip(singles, action, strict=True)]
        _assert_rows_equal(after, expected)


@pytest.mark.parametrize('ids', [[0, 0], [3], [-1], [0.5], 'all', [[0]], [True, False]])
def test_ids_that_make_no_sense_are_refused(ids):
    batch = fetch_composer.BatchEnvironment('push', 3, seed=0)
    first = batch.reset()
    with pytest.raises(ValueError, match='distinct integers from 0 to 2'):
        batch.reset(ids)
    again = fetch_composer.BatchEnvironment('push', 3, seed=0).reset()
    for name, value in first.observation.items():
        np.testing.assert_array_equal(value, again.observation[name])


def test_after_close_every_call_says_that_it_is_closed():
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0)
    batch.reset()
    batch.close()
    batch.close()
    calls = (
        batch.reset,
        lambda: batch.step(np.zeros((2, 4), np.float32)),
        lambda: batch.seed(0),
        lambda: batch.is_over,
        lambda: batch.steps_taken,
    )
    for call in calls:
        with pytest.raises(RuntimeError, match='closed'):
            call()


def test_a_refused_reset_has_drawn_nothing_and_leaves_nothing_to_step():
    refuse = [False]

    def mass(initial_value=None, current_value=None, random_state=None):
        drawn = random_state.uniform(1, 2)
        return -1.0 if refuse[0] and drawn > 1.5 else drawn

    kwargs = {'seed': 0, 'variations': {'object_mass': mass}}
    batch, reference = (fetch_composer.BatchEnvironment('push', 6, **kwargs) for _ in range(2))
    batch.reset()
    reference.reset()
    refuse[0] = True
    for call in batch.reset, lambda: batch.step(np.zeros((6, 4), np.float32)):
        with pytest.raises(ValueError, match='must be positive'):
            call()
    refuse[0] = False
    again, expected = batch.reset(), reference.reset()
    for name, value in expected.observation.items():
        np.testing.assert_array_equal(value, again.observation[name])


_FORK = """
import os, sys
import numpy as np
import fetch_composer
batch = fetch_composer.BatchEnvironment('push', 4, num_threads=2, seed=0)
batch.reset()
child = os.fork()
if child == 0:
    try:
        batch.step(np.zeros((4, 4), np.float32))
    except RuntimeError as error:
        print(error, flush=True)
    os._exit(0)
os.waitpid(child, 0)
print(batch.step(np.zeros((4, 4), np.float32)).step_type)
"""


def test_a_batch_in_a_forked_process_says_what_to_do():
    result = subprocess.run(
        [sys.executable, '-c', _FORK], capture_output=True, text=True, timeout=60
    )
    assert 'do not survive a fork' in result.stdout and "'spawn'" in result.stdout
    assert result.stdout.endswith('[1 1 1 1]\n'), result.stderr
