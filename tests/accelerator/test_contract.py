"""The batch on a device: its time steps and resets."""

import dataclasses

import dm_env
import numpy as np
import pytest

wp = pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

import fetch_composer  # noqa: E402
from fetch_composer import tasks  # noqa: E402
from fetch_composer.warp_batch import as_jax, as_numpy  # noqa: E402
from tests import episodes  # noqa: E402
from tests.accelerator.batches import ROUNDING, observation_of, zeros  # noqa: E402

pytestmark = pytest.mark.warp

_NUM_ENVS = 3


def test_specs_describe_the_time_steps(make, task_name, convention):
    batch = make(task_name, 2, seed=0, convention=convention)
    assert batch.action_spec().shape == (2, 4)
    batch.reset()
    time_step = as_numpy(batch.step(zeros(batch)))
    for name, spec in batch.observation_spec().items():
        spec.validate(time_step.observation[name])
    batch.reward_spec().validate(time_step.reward)
    batch.discount_spec().validate(time_step.discount)
    assert batch.num_envs == 2


def test_an_episode_has_the_steps_that_dm_env_has(make, task_name):
    batch = make(task_name, 2, seed=0, max_episode_steps=3)
    time_steps = [batch.reset(), *(batch.step(zeros(batch)) for _ in range(7))]
    types = [as_numpy(each.step_type)[0] for each in time_steps]
    first, mid, last = dm_env.StepType
    assert types == [first, mid, mid, last, first, mid, mid, last]
    assert as_numpy(time_steps[4].reward).tolist() == [0, 0]
    for each in time_steps:
        assert as_numpy(each.discount).tolist() == [1, 1]


def test_a_new_batch_starts_with_its_first_step(make):
    batch = make('push', 2, seed=0)
    stepped = as_numpy(batch.step(zeros(batch)))
    assert (stepped.step_type == dm_env.StepType.FIRST).all()
    again = as_numpy(make('push', 2, seed=0).reset())
    for name, value in stepped.observation.items():
        np.testing.assert_array_equal(value, again.observation[name])


def test_environments_that_end_at_different_times_start_anew_each_on_its_own(make):
    batch = make('push', _NUM_ENVS, seed=0, max_episode_steps=4)
    batch.reset()
    # As though this environment were two steps ahead.
    ahead = dataclasses.replace(batch.get_states([1])[0], steps_taken=2)
    batch.set_states([ahead], [1])
    types = []
    for actions in episodes.uniform_actions(7, batch_shape=(_NUM_ENVS,)):
        time_step = as_numpy(batch.step(actions))
        types.append([dm_env.StepType(t).name for t in time_step.step_type])
        first = time_step.step_type == dm_env.StepType.FIRST
        np.testing.assert_array_equal(time_step.observation['observation'][first, 14:], 0)
    assert [t[0] for t in types] == ['MID', 'MID', 'MID', 'LAST', 'FIRST', 'MID', 'MID']
    assert [t[1] for t in types] == ['MID', 'LAST', 'FIRST', 'MID', 'MID', 'MID', 'LAST']


def test_an_episode_ends_at_its_goal_if_it_is_to(make):
    goal = fetch_composer.load('reach', seed=0).reset().observation['achieved_goal']
    batch = make('reach', 2, seed=0, terminate_on_success=True, goal=goal)
    batch.reset(goal=[goal, goal + (0.1, 0.0, 0.0)])
    time_step = as_numpy(batch.step(zeros(batch)))
    assert time_step.step_type.tolist() == [dm_env.StepType.LAST, dm_env.StepType.MID]
    assert time_step.discount.tolist() == [0, 1]
    assert time_step.reward.tolist() == [0, -1]


def test_rewards_are_those_of_compute_reward(make, task_name):
    for reward_type in ('sparse', 'dense'):
        batch = make(task_name, 8, seed=0, reward_type=reward_type)
        batch.reset()
        time_step = as_numpy(batch.step(zeros(batch)))
        goals = [time_step.observation[name] for name in ('achieved_goal', 'desired_goal')]
        expected = fetch_composer.compute_reward(*goals, reward_type)
        np.testing.assert_allclose(time_step.reward, expected, atol=1e-6)


@pytest.mark.parametrize('ids', [[2, 0], np.array([True, False, True])], ids=['indices', 'mask'])
def test_those_that_are_not_reset_stay_as_they_are(make, convention, ids):
    batch = make('pick_and_place', _NUM_ENVS, seed=0, convention=convention)
    batch.reset()
    before = as_numpy(batch.step(np.ones((_NUM_ENVS, 4), np.float32)))
    after = as_numpy(batch.reset(ids))
    first, mid, _ = dm_env.StepType
    assert after.step_type.tolist() == [first, mid, first]
    assert after.reward.tolist() == [0] * _NUM_ENVS
    for name, value in after.observation.items():
        np.testing.assert_array_equal(value[1], before.observation[name][1])
    assert as_numpy(batch.steps_taken).tolist() == [0, 1, 0]


def test_time_steps_are_not_written_to_by_later_ones(make):
    batch = make('push', 2, seed=0)
    first = batch.reset()
    kept = as_numpy(first).observation
    batch.step(np.ones((2, 4), np.float32))
    for name, value in as_numpy(first).observation.items():
        np.testing.assert_array_equal(value, kept[name])


def test_jax_reads_and_writes_the_memory_of_the_device(make):
    jax = pytest.importorskip('jax', reason='JAX is not installed')
    if as_jax(wp.zeros(1, device=wp.get_device())).devices() != set(jax.devices()[:1]):
        pytest.skip('JAX has no such device')
    batch, other = make('reach', 4, seed=0), make('reach', 4, seed=0)
    observed, other_observed = as_jax(batch.reset()).observation, other.reset().observation
    np.testing.assert_array_equal(observed['observation'], as_numpy(other_observed['observation']))
    for _ in range(3):
        offset = observed['desired_goal'] - observed['achieved_goal']
        actions = jax.numpy.concatenate((10 * offset, jax.numpy.zeros((4, 1))), axis=1)
        observed = as_jax(batch.step(actions)).observation
        other_observed = as_numpy(other.step(np.array(actions))).observation
        np.testing.assert_allclose(
            observed['observation'], other_observed['observation'], rtol=0, atol=ROUNDING
        )


def test_actions_are_clipped(make):
    one, other = make('reach', 2, seed=0), make('reach', 2, seed=0)
    one.reset(), other.reset()
    np.testing.assert_allclose(
        observation_of(one.step(np.full((2, 4), 7.0))),
        observation_of(other.step(np.ones((2, 4), np.float32))),
        rtol=0,
        atol=ROUNDING,
    )


def test_it_has_every_published_task():
    assert set(tasks.published()) == {'pick_and_place', 'push', 'reach', 'slide'}
