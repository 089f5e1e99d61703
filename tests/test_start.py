"""Where episodes start: poses, samples, seeds and given places."""

import subprocess
import sys

import numpy as np
import pytest

import fetch_composer
from tests import episodes

_GRIPPER_START = {
    'push': (1.3419, 0.7491, 0.555),
    'reach': (1.3419, 0.7491, 0.555),
    'pick_and_place': (1.3419, 0.7491, 0.555),
    'slide': (1.013, 0.7492, 0.555),
}
_POINTING_DOWN = np.array((1, 0, 1, 0)) / np.sqrt(2)
_TABLE_TOP = 0.4  # m
# Half the object's height in m, and half the range of its offset and of the goal's.
_OBJECTS = {
    'push': (0.025, 0.15, 0.15),
    'pick_and_place': (0.025, 0.15, 0.15),
    'slide': (0.02, 0.1, 0.3),
}


def _distance_of_quaternions(one, other) -> float:
    return min(np.abs(one - other).max(), np.abs(one + other).max())


def test_documented_gripper_starts_at_rest_at_its_pose(task_name):
    env = episodes.shared(task_name)
    for _ in range(5):
        observation = env.reset().observation['observation']
        body = env.physics.named.data
        position = body.xpos['fetch/gripper/gripper_link']
        quaternion = body.xquat['fetch/gripper/gripper_link']
        np.testing.assert_allclose(position, _GRIPPER_START[task_name], atol=1e-5)
        assert _distance_of_quaternions(quaternion, _POINTING_DOWN) < 1e-5
        np.testing.assert_allclose(observation[:3], position - (0, 0, 0.02), atol=1e-5)
        np.testing.assert_array_equal(env.physics.data.qvel, 0)
        velocities = observation[-5:] if task_name == 'reach' else observation[14:]
        np.testing.assert_array_equal(velocities, 0)


def test_documented_base_is_fixed(task_name):
    env = episodes.shared(task_name)
    frame = env.physics.named.data.xpos['fetch/']
    expected = {'slide': 0.05, 'reach': 0.4049}.get(task_name, 0.405)
    np.testing.assert_allclose(frame, (expected, 0.48, 0), atol=1e-9)
    before = np.array(env.physics.named.data.xpos['fetch/shoulder_pan_link'])
    episodes.run(env, episodes.uniform_actions(50))
    np.testing.assert_array_equal(env.physics.named.data.xpos['fetch/shoulder_pan_link'], before)


def test_documented_object_starts_upright_to_its_observer(object_task_name):
    env = episodes.shared(object_task_name)
    observation = env.reset().observation['observation']
    quaternion = env.physics.named.data.xquat['block/']
    assert _distance_of_quaternions(quaternion, _POINTING_DOWN) < 1e-9
    np.testing.assert_allclose(observation[11:14], 0, atol=1e-9)


def test_zero_action_holds_the_documented_gripper(task_name):
    env = episodes.shared(task_name)
    time_steps = episodes.run(env, np.zeros((50, 4), np.float32))
    grip = np.array([t.observation['observation'][:3] for t in time_steps])
    assert np.abs(grip - grip[0]).max() < 1e-3


def test_starts_and_goals_fill_their_ranges(object_task_name):
    half_height, object_range, goal_range = _OBJECTS[object_task_name]
    env = episodes.shared(object_task_name)
    observations = [env.reset().observation for _ in range(1000)]
    centre = np.array(_GRIPPER_START[object_task_name][:2])
    positions = np.array([o['achieved_goal'] for o in observations])
    offsets = positions[:, :2] - centre
    assert np.abs(offsets).max() <= object_range
    assert (np.ptp(offsets, axis=0) > 1.9 * object_range).all()
    assert np.linalg.norm(offsets, axis=1).min() >= 0.1
    np.testing.assert_allclose(positions[:, 2], _TABLE_TOP + half_height, atol=2e-4)

    goals = np.array([o['desired_goal'] for o in observations])
    if object_task_name == 'slide':
        centre = centre + (0.4, 0)
    assert np.abs(goals[:, :2] - centre).max() <= goal_range
    assert (np.ptp(goals[:, :2], axis=0) > 1.9 * goal_range).all()
    height = goals[:, 2] - positions[:, 2]
    if object_task_name == 'pick_and_place':
        assert 0.45 < (height > 1e-9).mean() < 0.55
        assert height.max() <= 0.45
        assert height.max() > 0.43
    else:
        np.testing.assert_allclose(height, 0, atol=1e-9)


def test_reach_goals_fill_a_cube_around_the_gripper():
    env = fetch_composer.load('reach', seed=0)
    observations = [env.reset().observation for _ in range(500)]
    offsets = np.array([o['desired_goal'] - o['achieved_goal'] for o in observations])
    assert np.abs(offsets).max() <= 0.15 + 1e-6
    assert (np.ptp(offsets, axis=0) > 0.28).all()


def test_a_seed_fixes_everything(task_name, convention):
    actions = episodes.uniform_actions(130, seed=5)  # Three episodes.
    made = fetch_composer.load(task_name, seed=11, convention=convention)
    seeded = episodes.shared(task_name, 11, convention=convention)
    episodes.assert_same(*(episodes.run(env, actions) for env in (made, seeded)))


def test_seeds_differ(task_name):
    goals = [fetch_composer.load(task_name, seed=s).reset().observation for s in range(3)]
    assert len({tuple(o['desired_goal']) for o in goals}) == 3


_FINGERPRINT = """
import sys
import fetch_composer
from tests import episodes
env = fetch_composer.load(sys.argv[1], seed=4, convention=sys.argv[2])
steps = episodes.run(env, episodes.uniform_actions(60, seed=2))
print([value.hex() for step in steps for value in step.observation['observation']])
"""


@pytest.mark.parametrize('name', ['push', 'pick_and_place'])
def test_a_seed_fixes_everything_across_processes(name, convention):
    command = [sys.executable, '-c', _FINGERPRINT, name, convention]
    there = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    env = fetch_composer.load(name, seed=4, convention=convention)
    steps = episodes.run(env, episodes.uniform_actions(60, seed=2))
    here = [value.hex() for step in steps for value in step.observation['observation']]
    assert len(here) > 1000 and there == f'{here}\n'


def test_reset_restores_everything(task_name, convention):
    """Nothing of an episode, such as a warm start, is left in the next one."""
    actions = episodes.uniform_actions(20, seed=7)
    fresh = fetch_composer.load(task_name, seed=9, convention=convention)
    used = episodes.shared(task_name, 1, convention=convention)
    episodes.run(used, episodes.uniform_actions(33, seed=8))
    used.seed(9)
    episodes.assert_same(episodes.run(used, actions), episodes.run(fresh, actions))


def test_given_places_are_taken_for_one_episode(object_task_name, convention):
    env = fetch_composer.load(object_task_name, seed=0, convention=convention)
    centre = np.array(env.task.workspace.table_position[:2])
    object_position, goal = centre + (0.1, 0.2), np.array([*(centre - 0.1), 0.45])
    env.task.set_next_episode(object_position=object_position, goal=goal)
    given = env.reset().observation
    np.testing.assert_allclose(given['achieved_goal'][:2], object_position, atol=1e-12)
    np.testing.assert_array_equal(given['desired_goal'], goal)
    sampled = env.reset().observation
    assert np.abs(sampled['desired_goal'] - goal).max() > 1e-3


def test_given_places_as_options_hold_for_every_episode(task_name):
    goal = (1.2, 0.7, 0.5)
    env = fetch_composer.load(task_name, seed=0, goal=goal)
    for _ in range(3):
        np.testing.assert_array_equal(env.reset().observation['desired_goal'], goal)


def test_giving_one_place_leaves_the_other_as_sampled(object_task_name):
    sampled = episodes.shared(object_task_name, 3).reset().observation
    given = fetch_composer.load(object_task_name, seed=3, goal=(1.2, 0.7, 0.45))
    np.testing.assert_array_equal(
        given.reset().observation['achieved_goal'], sampled['achieved_goal']
    )


def test_the_target_is_drawn_at_the_goal(task_name):
    env = episodes.shared(task_name)
    for _ in range(3):
        goal = env.reset().observation['desired_goal']
        np.testing.assert_array_equal(env.physics.named.data.site_xpos['target/target'], goal)
