"""The batch on a device: what is drawn and given at the start of an episode."""

import itertools

import numpy as np
import pytest

wp = pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

from scipy import stats  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer.warp_batch import as_numpy, philox  # noqa: E402

pytestmark = pytest.mark.warp


@wp.kernel(enable_backward=False)
def _blocks(
    counters: wp.array(dtype=philox.Block),
    keys: wp.array(dtype=philox.Key),
    words: wp.array(dtype=philox.Block),
):
    i = wp.tid()
    words[i] = philox.block(counters[i], keys[i])


def test_the_generator_gives_the_answers_that_its_authors_publish(device):
    """From kat_vectors of Random123."""
    ones = 0xFFFFFFFF
    counters = [[0] * 4, [ones] * 4, [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344]]
    keys = [[0] * 2, [ones] * 2, [0xA4093822, 0x299F31D0]]
    expected = [
        [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8],
        [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ]
    with wp.ScopedDevice(device):
        words = wp.zeros(3, dtype=philox.Block)
        arguments = [
            wp.array(np.array(counters, np.uint32), dtype=philox.Block),
            wp.array(np.array(keys, np.uint32), dtype=philox.Key),
            words,
        ]
        wp.launch(_blocks, dim=3, inputs=arguments)
    np.testing.assert_array_equal(words.numpy(), np.array(expected, np.uint32))


def test_every_episode_of_every_environment_has_a_fresh_start(make, task_name):
    batch = make(task_name, 50, seed=0)
    seen = [as_numpy(batch.reset()).observation for _ in range(4)]
    goals = np.concatenate([each['desired_goal'] for each in seen])
    assert len(np.unique(goals, axis=0)) == len(goals)
    if task_name != 'reach':
        places = np.concatenate([each['achieved_goal'] for each in seen])
        assert len(np.unique(places, axis=0)) == len(places)


def test_starts_and_goals_are_distributed_as_those_of_the_native_batch(make, task_name, convention):
    count = 2000
    ours = as_numpy(make(task_name, count, seed=0, convention=convention).reset()).observation
    native = fetch_composer.BatchEnvironment(task_name, count, seed=0, convention=convention)
    theirs = native.reset().observation
    for name, axis in itertools.product(('achieved_goal', 'desired_goal'), range(3)):
        # Many goals are at one height, which has other last digits in single precision.
        one, other = (each[name][:, axis].astype(float).round(5) for each in (ours, theirs))
        np.testing.assert_allclose(
            (one.min(), one.max()), (other.min(), other.max()), atol=0.01, err_msg=name
        )
        if np.ptp(other) > 1e-6:
            assert stats.ks_2samp(one, other).pvalue > 1e-4, (name, axis)


def test_a_seed_fixes_what_is_drawn_and_each_environment_draws_its_own(make):
    def goals(batch):
        return as_numpy(batch.reset().observation['desired_goal'])

    batch = make('push', 3, seed=5)
    drawn = [goals(batch) for _ in range(3)]
    single = make('push', 1, seed=6)
    for each in drawn:
        np.testing.assert_array_equal(goals(single)[0], each[1])
    batch.seed(5)
    np.testing.assert_array_equal(goals(batch), drawn[0])
    np.testing.assert_array_equal(
        as_numpy(batch.reset(seed=[7, 6, 5]).observation['desired_goal'])[[2, 1]], drawn[0][[0, 1]]
    )


def test_given_places_may_be_one_for_all_or_one_for_each(make):
    batch = make('push', 2, seed=0)
    goals = np.array([[1.2, 0.7, 0.425], [1.3, 0.8, 0.425]])
    observation = as_numpy(batch.reset(object_position=(1.25, 0.6), goal=goals)).observation
    np.testing.assert_allclose(observation['achieved_goal'][:, :2], [(1.25, 0.6)] * 2, atol=1e-6)
    np.testing.assert_allclose(observation['desired_goal'], goals, atol=1e-6)


def test_a_place_that_is_given_leaves_the_other_as_it_was(make):
    one, other = make('push', 2, seed=0), make('push', 2, seed=0)
    drawn = as_numpy(one.reset()).observation
    given = as_numpy(other.reset(goal=(1.2, 0.7, 0.425))).observation
    np.testing.assert_array_equal(drawn['achieved_goal'], given['achieved_goal'])
    for one_next, other_next in zip(
        as_numpy(one.reset()).observation.values(),
        as_numpy(other.reset()).observation.values(),
        strict=True,
    ):
        np.testing.assert_array_equal(one_next, other_next)


def test_places_of_every_episode_hold_in_every_one(make):
    batch = make('push', 2, seed=0, goal=(1.2, 0.7, 0.425), object_position=(1.25, 0.6))
    for _ in range(2):
        observation = as_numpy(batch.reset()).observation
        np.testing.assert_allclose(observation['desired_goal'], [(1.2, 0.7, 0.425)] * 2, atol=1e-6)
        np.testing.assert_allclose(
            observation['achieved_goal'][:, :2], [(1.25, 0.6)] * 2, atol=1e-6
        )
