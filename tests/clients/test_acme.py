"""Acme: its loop drives the tasks, and its wrappers see what it expects to see."""

import numpy as np
import pytest

from fetch_composer import suite

acme = pytest.importorskip('acme', reason="Acme is not installed: pip install -e '.[acme]'")

pytestmark = pytest.mark.clients


@pytest.fixture
def wrappers():
    return pytest.importorskip(
        'acme.wrappers',
        reason='the wrappers of Acme 0.2.4 need a jax of their time: see docs/clients.md',
    )


def test_the_loop_of_the_example_runs_whole_episodes(run_example):
    printed = run_example('acme_loop.py', '--episodes=3')
    assert 'Episode Length = 50' in printed
    assert 'Episodes = 3 | Steps = 150' in printed


def test_the_specs_are_those_of_the_environment(task_name):
    env = suite.load('fetch', task_name)
    spec = acme.make_environment_spec(env)
    assert spec.actions == env.action_spec()
    assert spec.observations == env.observation_spec()
    assert spec.rewards == env.reward_spec()
    assert spec.discounts == env.discount_spec()


def test_wrapped_observations_are_one_vector_of_single_precision(wrappers, task_name):
    env = suite.load('fetch', task_name, {'random': 0})
    expected = suite.load('fetch', task_name, {'random': 0}).reset().observation
    env = wrappers.wrap_all(
        env, [wrappers.SinglePrecisionWrapper, wrappers.ConcatObservationWrapper]
    )
    time_step = env.reset()
    # Acme sorts the parts by name.
    parts = [expected[name] for name in ('achieved_goal', 'desired_goal', 'observation')]
    np.testing.assert_array_equal(time_step.observation, np.float32(np.concatenate(parts)))
    env.observation_spec().validate(time_step.observation)
    time_step = env.step(env.action_spec().generate_value())
    assert time_step.observation.dtype == time_step.reward.dtype == np.float32


def test_the_example_runs_with_acmes_wrappers(wrappers, run_example):
    del wrappers  # Skips where there are none.
    printed = run_example('acme_loop.py', '--episodes=1', '--wrap')
    assert 'shape=(31,)' in printed
