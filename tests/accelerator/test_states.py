"""The batch on a device: states that are saved and gone back to."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

import fetch_composer  # noqa: E402
from fetch_composer.tasks.state import State  # noqa: E402
from fetch_composer.warp_batch import as_numpy  # noqa: E402
from tests import episodes  # noqa: E402
from tests.accelerator.batches import ROUNDING, observation_of  # noqa: E402

pytestmark = pytest.mark.warp


def test_what_follows_a_restored_state_is_what_followed_when_it_was_taken(
    make, task_name, convention, tmp_path
):
    batch = make(task_name, 2, seed=3, convention=convention, max_episode_steps=9)
    actions = episodes.uniform_actions(26, batch_shape=(2,))
    batch.reset()
    for each in actions[:13]:
        batch.step(each)
    states = batch.get_states()
    expected = [observation_of(batch.step(each)) for each in actions[13:]]
    other = make(task_name, 2, seed=8, convention=convention, max_episode_steps=9)
    for i, state in enumerate(states):
        state.save(tmp_path / f'{i}.npz')
        other.set_states([State.load(tmp_path / f'{i}.npz')], [i])
    for each, value in zip(actions[13:], expected, strict=True):
        np.testing.assert_allclose(observation_of(other.step(each)), value, rtol=0, atol=ROUNDING)


def test_states_go_to_and_from_single_environments(make, task_name, convention):
    single = fetch_composer.load(task_name, seed=0, convention=convention)
    episodes.run(single, episodes.uniform_actions(12))
    state = single.get_state()
    batch = make(task_name, 2, seed=0, convention=convention)
    batch.reset()
    batch.set_states([state], [1])
    taken = batch.get_states([1])[0]
    np.testing.assert_allclose(taken.physics, state.physics, atol=1e-6)
    assert (taken.steps_taken, taken.is_over) == (state.steps_taken, state.is_over)
    single.set_state(dataclasses.replace(taken, generator=state.generator))
    for action in episodes.uniform_actions(5, seed=1):
        expected = single.step(action).observation['achieved_goal']
        found = as_numpy(batch.step(np.stack((action, action)))).observation['achieved_goal'][1]
        np.testing.assert_allclose(found, expected, atol=2e-4)


def test_a_state_that_does_not_fit_is_refused_and_nothing_changes(make):
    batch = make('push', 2, seed=0)
    batch.reset()
    before = observation_of(batch.reset([]))
    (fitting,) = batch.get_states([0])
    of_another = make('reach', 1, seed=0)
    of_another.reset()
    broken = dataclasses.replace(
        fitting, generator={'bit_generator': 'Philox4x32', 'key': [1], 'drawn': -1}
    )
    for state, message in [
        (of_another.get_states()[0], 'task_name'),
        (broken, 'two words'),
        (dataclasses.replace(fitting, physics=np.zeros(3)), 'physics'),
    ]:
        with pytest.raises(ValueError, match=message):
            batch.set_states([fitting, state])
    np.testing.assert_array_equal(observation_of(batch.reset([])), before)
