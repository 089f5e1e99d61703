"""The batch on a device: what it refuses, and what it reports."""

import dataclasses

import dm_env
import numpy as np
import pytest

wp = pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

from dm_control.rl import control  # noqa: E402

from fetch_composer.warp_batch import as_numpy  # noqa: E402
from tests import episodes  # noqa: E402
from tests.accelerator.batches import ROUNDING, observation_of, zeros  # noqa: E402

pytestmark = pytest.mark.warp


@pytest.mark.parametrize(
    ('actions', 'message'),
    [
        (np.zeros((2, 3)), r'shape \(2, 4\)'),
        (np.zeros((3, 4)), r'shape \(2, 4\)'),
        ([['a'] * 4] * 2, 'numbers'),
        (wp.zeros((2, 4), dtype=wp.float64, device='cpu'), 'float32'),
    ],
)
def test_actions_of_another_kind_are_refused(make, actions, message):
    batch = make('push', 2, seed=0)
    batch.reset()
    with pytest.raises(ValueError, match=message):
        batch.step(actions)
    assert as_numpy(batch.steps_taken).tolist() == [0, 0]


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_actions_that_are_not_finite_are_reported_and_taken_as_zeros(make, value):
    batch, other = make('push', 3, seed=0), make('push', 3, seed=0)
    batch.reset(), other.reset()
    actions = np.zeros((3, 4), np.float32)
    actions[1, 2] = value
    with pytest.raises(ValueError, match=r'rows \[1\]'):
        batch.step(actions)
        batch.check()
    other.step(zeros(other))
    batch.check()
    np.testing.assert_allclose(
        observation_of(batch.step(zeros(batch))),
        observation_of(other.step(zeros(other))),
        rtol=0,
        atol=ROUNDING,
    )


def test_an_environment_that_diverges_is_reported_and_starts_anew_alone(make):
    batch, other = make('push', 3, seed=0), make('push', 3, seed=0)
    batch.reset(), other.reset()
    (state,) = batch.get_states([1])
    physics = state.physics.copy()
    physics[1 + 14 + 5] = 1e8  # rad/s of a joint of the arm.
    batch.set_states([dataclasses.replace(state, physics=physics)], [1])
    with pytest.raises(control.PhysicsError, match=r'\[1\]'):
        for _ in range(5):
            batch.step(zeros(batch))
            batch.check()
    steps = int(as_numpy(batch.steps_taken)[0])
    for _ in range(steps):
        other.step(zeros(other))
    time_step, expected = as_numpy(batch.step(zeros(batch))), as_numpy(other.step(zeros(other)))
    first, mid, _ = dm_env.StepType
    assert time_step.step_type.tolist() == [mid, first, mid]
    observation = time_step.observation['observation']
    assert np.isfinite(observation).all()
    np.testing.assert_allclose(
        observation[[0, 2]], expected.observation['observation'][[0, 2]], atol=1e-6
    )


@pytest.mark.parametrize('name', ['nconmax', 'njmax'])
def test_too_little_room_is_an_error_that_names_what_to_raise(make, name):
    batch = make('push', 2, seed=0, **{name: 1})
    batch.reset()
    with pytest.raises(RuntimeError, match=rf'{name} \(1\) was too small .* {name}=2'):
        batch.step(zeros(batch))
        batch.check()


def test_there_is_room_for_what_random_actions_need(make, task_name, convention):
    batch = make(task_name, 20, seed=0, convention=convention)
    batch.reset()
    for actions in episodes.uniform_actions(50, batch_shape=(20,)):
        actions[::2, 2] -= 0.6
        actions[::2, 3] -= 0.5
        batch.step(actions)
    batch.check()


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'task': 'walk'}, 'valid are'),
        ({'task': 'push_two'}, 'push_two'),
        ({'task': 'push_around'}, 'push_around'),
        ({'num_envs': 0}, 'num_envs'),
        ({'device': 'tpu'}, 'Unknown device .* valid are'),
        ({'seed': -1}, 'seed'),
        ({'njmax': 0}, 'njmax'),
        ({'convert': 'torch'}, 'convert'),
        ({'observation_mode': 'pixels'}, 'observation_mode'),
        ({'action_mode': 'joints'}, 'action_mode'),
        ({'variations': {'friction': 0.5}}, 'variations'),
        ({'goal': (9.0, 9.0, 9.0)}, 'off the table'),
    ],
)
def test_what_it_has_not_is_refused(device, options, message):
    from fetch_composer.warp_batch import WarpBatchEnvironment

    with pytest.raises(ValueError, match=message):
        WarpBatchEnvironment(**{'task': 'push', 'num_envs': 2, 'device': device, **options})


def test_bad_resets_are_refused_and_nothing_changes(make):
    batch = make('push', 2, seed=0)
    batch.reset()
    before = observation_of(batch.step(zeros(batch)))
    for arguments, message in [
        ({'ids': [2]}, 'ids'),
        ({'goal': (9.0, 9.0, 9.0)}, 'off the table'),
        ({'object_position': (1.0, np.nan)}, 'object_position'),
        ({'seed': 'a'}, 'seed'),
    ]:
        with pytest.raises(ValueError, match=message):
            batch.reset(**arguments)
    np.testing.assert_array_equal(observation_of(batch.reset([])), before)


def test_a_closed_batch_says_so(make):
    batch = make('reach', 1, seed=0)
    batch.close()
    batch.close()
    for use in (batch.reset, batch.check, batch.get_states, lambda: batch.step(np.zeros((1, 4)))):
        with pytest.raises(RuntimeError, match='closed'):
            use()
