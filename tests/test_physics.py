"""Physics that behaves as one would expect of a robot, a table and a block."""

import mujoco
import numpy as np
import pytest

import fetch_composer
from tests import episodes


def _object_pose(env) -> np.ndarray:
    return np.array(env.physics.named.data.qpos['block/free/'])


def test_an_object_at_rest_neither_sinks_nor_jitters_nor_drifts(object_task_name):
    env = fetch_composer.load(object_task_name, seed=0, max_episode_steps=None)
    env.reset()
    start = _object_pose(env)
    poses = []
    for _ in range(250):  # 10 s
        env.step(np.zeros(4, np.float32))
        poses.append(_object_pose(env))
    assert np.abs(np.array(poses)[:, :3] - start[:3]).max() < 1e-4
    assert np.abs(np.array(poses)[:, 3:] - start[3:]).max() < 1e-3


def test_a_pushed_block_moves_and_stops():
    env = fetch_composer.load('push', seed=0, max_episode_steps=None, object_position=(1.3, 0.6))
    time_step = env.reset()
    start = time_step.observation['achieved_goal']
    for _ in range(25):
        time_step = env.step(episodes.push_through(time_step.observation))
    assert time_step.observation['achieved_goal'][1] - start[1] > 0.05
    away = np.array([0, -1, 1, 0], np.float32)
    for _ in range(20):
        time_step = env.step(away)
    stopped = time_step.observation['achieved_goal']
    for _ in range(25):
        time_step = env.step(np.zeros(4, np.float32))
    np.testing.assert_allclose(time_step.observation['achieved_goal'], stopped, atol=1e-4)
    assert stopped[2] == pytest.approx(0.4249, abs=1e-3)  # It stayed on the table.


def test_a_puck_that_was_hit_coasts_away_from_the_gripper():
    env = fetch_composer.load('slide', seed=0, max_episode_steps=None)
    observation = env.reset().observation
    observation = episodes.push_until(env, observation, 0.8)
    released = observation['achieved_goal'][1]
    for _ in range(25):
        observation = env.step(np.array([0, -1, 0, 0], np.float32)).observation
    assert observation['achieved_goal'][1] > released + 0.05


def test_the_arm_does_not_pass_through_the_table(task_name, convention):
    env = fetch_composer.load(task_name, seed=0, convention=convention, max_episode_steps=None)
    env.reset()
    for _ in range(60):
        time_step = env.step(np.array([0, 0, -1, 0], np.float32))
    # The fingertips are 0.0185 m below the observed site; a soft contact gives a little.
    assert time_step.observation['observation'][2] - 0.0185 > 0.4 - 0.02


def test_the_arm_reaches_its_commanded_place_without_shaking(task_name):
    env = fetch_composer.load(task_name, seed=0, max_episode_steps=None)
    observation = env.reset().observation
    target = observation['observation'][:3] + (0.05, -0.08, 0.05)
    positions = []
    for _ in range(80):
        observation = env.step(episodes.towards(observation, target)).observation
        positions.append(observation['observation'][:3])
    np.testing.assert_allclose(positions[-1], target, atol=2e-3)
    assert np.ptp(positions[-20:], axis=0).max() < 1e-3


def test_each_axis_of_the_action_moves_its_own_axis(task_name, convention):
    # Upwards, since Push and Slide of Gymnasium-Robotics start pressed onto the table.
    for axis in range(3):
        env = episodes.shared(task_name, convention=convention)
        env.reset()
        lift = np.array([0, 0, 1, 0], np.float32)
        for _ in range(4):
            before = env.step(lift).observation['observation'][:3]
        action = np.zeros(4, np.float32)
        action[axis] = 1
        for _ in range(4):
            after = env.step(action).observation['observation'][:3]
        moved = after - before
        assert 0.05 < moved[axis] < 0.25
        assert np.abs(np.delete(moved, axis)).max() < 0.06


def test_a_block_can_be_grasped_and_lifted():
    env = fetch_composer.load('pick_and_place', seed=0, max_episode_steps=None)
    observation = env.reset().observation
    for step in range(80):
        block = observation['achieved_goal']
        above = np.abs(observation['observation'][:2] - block[:2]).max() < 0.01
        if step < 40:
            height = 0.0 if above else 0.1
            action = episodes.towards(observation, block + (0, 0, height))
            action[3] = 1
        else:
            action = np.array([0, 0, 1 if step > 50 else 0, -1], np.float32)
        observation = env.step(action).observation
    assert observation['achieved_goal'][2] > 0.5


def test_the_gripper_keeps_pointing_down(task_name):
    env = episodes.shared(task_name)
    episodes.run(env, episodes.uniform_actions(40))
    xmat = env.physics.named.data.xmat['fetch/gripper/gripper_link'].reshape(3, 3)
    assert xmat[2, 0] < -0.98  # The fingers' axis against the vertical.


def test_the_model_is_lean(task_name):
    env = episodes.shared(task_name)
    model = env.physics.model
    expected = {'reach': 7, 'pick_and_place': 15}.get(task_name, 13)
    assert model.nv == expected
    assert model.nsensor == 0
    colliding = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    assert colliding.sum() <= 16
    assert model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert model.opt.noslip_iterations == 0
