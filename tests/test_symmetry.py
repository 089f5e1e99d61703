"""The simulation agrees that what holds in one place holds mirrored, and elsewhere."""

import numpy as np
import pytest

for _package in ('jax', 'optax'):
    pytest.importorskip(_package, reason="needs pip install 'fetch_composer[learn]'")

import fetch_composer  # noqa: E402
from fetch_composer.learning import symmetry  # noqa: E402
from tests import episodes  # noqa: E402

_STEPS = 16
_SETTLING = 6


def _episode(task, convention, places, actions=None):
    """Returns observations and actions of an episode; without actions it goes for the object."""
    made = []
    with fetch_composer.load(task, convention=convention, **places) as env:
        observed = env.reset().observation
        observations = [observed['observation']]
        for i in range(_STEPS):
            if actions is None:
                way = observed['achieved_goal'] - observations[-1][:3] + [0, 0.02, 0]
                made.append(np.append(np.clip(way / 0.05, -0.5, 0.5), np.sin(i)))
            else:
                made.append(actions[i])
            observed = env.step(made[-1]).observation
            observations.append(observed['observation'])
    return np.array(observations), np.array(made)


@pytest.mark.parametrize('beside', [0.11, -0.12])
def test_a_mirrored_episode_is_simulated_alike(task_name, convention, beside):
    env = episodes.shared(task_name, convention=convention)
    x, plane, _ = env.reset().observation['observation'][:3]
    there, here = {}, {}
    if task_name != 'reach':
        there = {'object_position': (x + 0.06, plane + beside)}
        here = {'object_position': (x + 0.06, plane - beside)}
    observations, actions = _episode(task_name, convention, there)
    mirror = symmetry.Mirror(observations.shape[-1], plane)
    mirrored, _ = _episode(task_name, convention, here, mirror.action(actions))
    assert np.ptp(observations[:, 1]) > 0.05
    difference = np.abs(mirror.observation(observations) - mirrored)
    # Contacts make a hair's breadth grow: a block that is hit beside its middle turns.
    limits = np.full(observations.shape[-1], 0.01)
    limits[:3] = 0.001
    if task_name != 'reach':
        limits[11:14], limits[14:17], limits[17:20] = 0.3, 0.02, 0.4
    assert (difference.max(axis=0) < limits).all()


@pytest.mark.parametrize('observation_size', [10, 25, 40])
def test_a_mirrored_mirror_image_is_what_was_mirrored(observation_size):
    mirror = symmetry.Mirror(observation_size, 0.75)
    observation = np.random.default_rng(0).normal(size=(4, observation_size)).astype(np.float32)
    again = mirror.observation(mirror.observation(observation))
    np.testing.assert_allclose(again, observation, atol=1e-6)
    assert (mirror.observation(observation) != observation).any(axis=0).sum() > 2
    goal = observation[:, : 6 if observation_size == 40 else 3]
    np.testing.assert_allclose(mirror.goal(goal)[:, 1::3], 1.5 - goal[:, 1::3])
    np.testing.assert_array_equal(mirror.goal(goal)[:, ::3], goal[:, ::3])
    np.testing.assert_array_equal(mirror.action(observation[:, :4])[:, 1], -observation[:, 1])


@pytest.mark.parametrize('way', [(-0.5, 0), (0, 0.5), (0, -0.5)])
def test_the_gripper_moves_alike_elsewhere(convention, way):
    """What is moved are places of gripper, objects and goals; not the ways between them."""

    def run(first):
        actions = [np.append(first, [0, 0])] * _SETTLING + [np.zeros(4)] * _SETTLING
        actions += [np.array([np.sin(i), np.cos(i), np.sin(2 * i), 0]) for i in range(_STEPS)]
        env = episodes.shared('reach', convention=convention)
        seen = [each.observation['observation'] for each in episodes.run(env, actions)[1:]]
        return np.array(seen[2 * _SETTLING - 1 :])

    here, there = run((0, 0)), run(way)
    by = there[:1, :2] - here[:1, :2]
    assert np.abs(by).max() > 0.08
    shifted = symmetry.Shift(10).observation(here, by)
    np.testing.assert_allclose(shifted[:, :3], there[:, :3], atol=0.004)
    np.testing.assert_allclose(shifted[:, 3:], there[:, 3:], atol=0.004)


def test_all_that_is_on_the_table_is_shifted():
    observation, by = np.zeros((1, 40), np.float32), np.array([[0.1, -0.2]])
    shifted = symmetry.Shift(40).observation(observation, by)[0]
    places = [0, 1, 10, 11, 25, 26]  # Of the gripper and of both objects.
    np.testing.assert_allclose(shifted[places], [0.1, -0.2] * 3)
    assert np.count_nonzero(shifted) == len(places)
    goal = symmetry.Shift(40).goal(np.zeros((1, 6), np.float32), by)[0]
    np.testing.assert_allclose(goal, [0.1, -0.2, 0, 0.1, -0.2, 0])
