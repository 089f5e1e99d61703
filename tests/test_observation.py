"""Each number of the observation against its formula, from the simulation's own state."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import transform

import fetch_composer
from fetch_composer.tasks import observation as observation_lib
from tests import episodes

_TIMESTEP = 0.04  # s


def _pushed(env, steps: int):
    """Yields observations while the gripper pushes the object."""
    time_step = env.reset()
    for _ in range(steps):
        time_step = env.step(episodes.push_through(time_step.observation))
        yield time_step.observation


def _velocity(env, site: str) -> tuple[np.ndarray, np.ndarray]:
    angular_linear = np.zeros(6)
    physics = env.physics
    site_id = physics.model.name2id(site, 'site')
    mujoco.mj_objectVelocity(
        physics.model.ptr, physics.data.ptr, mujoco.mjtObj.mjOBJ_SITE, site_id, angular_linear, 0
    )
    return angular_linear[3:], angular_linear[:3]


def test_gripper_and_object_are_observed_where_they_are(object_task_name):
    env = episodes.shared(object_task_name)
    for observation in _pushed(env, 40):
        vector = observation['observation']
        site = env.physics.named.data.site_xpos
        np.testing.assert_array_equal(vector[:3], site['fetch/gripper/grip'])
        np.testing.assert_array_equal(vector[3:6], site['block/block'])
        np.testing.assert_array_equal(vector[3:6], observation['achieved_goal'])


def test_velocities_are_those_of_the_simulation_times_the_control_timestep(object_task_name):
    env = episodes.shared(object_task_name)
    moved = 0.0
    for observation in _pushed(env, 40):
        vector = observation['observation']
        grip, _ = _velocity(env, 'fetch/gripper/grip')
        block, spin = _velocity(env, 'block/block')
        np.testing.assert_allclose(vector[20:23], grip * _TIMESTEP, atol=1e-12)
        np.testing.assert_allclose(vector[14:17], (block - grip) * _TIMESTEP, atol=1e-12)
        np.testing.assert_allclose(vector[17:20], spin * _TIMESTEP, atol=1e-12)
        moved = max(moved, np.abs(block).max())
    assert moved > 0.05  # The object was pushed, so this was no comparison of zeros.


def test_velocities_are_displacements_per_control_step():
    """A puck that coasts moves by its velocity, so that neither unit nor sign can be wrong."""
    env = fetch_composer.load('slide', seed=0, max_episode_steps=None)
    positions, velocities = [], []
    for observation in _pushed(env, 60):
        vector = observation['observation']
        positions.append(vector[3:6])
        velocities.append(vector[14:17] + vector[20:23])
    moved = np.diff(positions, axis=0)
    mean_velocity = (np.array(velocities)[1:] + velocities[:-1]) / 2
    coasting = np.abs(np.diff(velocities, axis=0)).max(axis=1) < 2e-3
    fast = coasting & (np.abs(moved[:, 1]) > 3e-3)
    assert fast.sum() >= 3
    np.testing.assert_allclose(moved[fast, :2], mean_velocity[fast, :2], rtol=0.1, atol=2e-4)


def test_difference_is_gripper_minus_object_as_documented(object_task_name, convention):
    env = episodes.shared(object_task_name, convention=convention)
    sense = 1 if convention == 'documented' else -1
    for time_step in episodes.run(env, episodes.uniform_actions(10)):
        vector = time_step.observation['observation']
        np.testing.assert_allclose(vector[6:9], sense * (vector[:3] - vector[3:6]), atol=1e-12)


def test_fingers_are_observed_right_then_left():
    env = fetch_composer.load('pick_and_place', seed=0)
    env.reset()
    for _ in range(10):
        observation = env.step(np.array([0, 0, 0, 1], np.float32)).observation['observation']
    joints = env.physics.named.data
    right, left = 'fetch/gripper/r_gripper_finger_joint', 'fetch/gripper/l_gripper_finger_joint'
    np.testing.assert_allclose(
        observation[9:11], [joints.qpos[right].item(), joints.qpos[left].item()]
    )
    assert (observation[9:11] > 0.02).all()
    for _ in range(10):
        observation = env.step(np.array([0, 0, 0, -1], np.float32)).observation['observation']
    assert (observation[9:11] < 0.01).all()


def test_euler_angles_are_continuous_while_an_object_is_pushed():
    env = fetch_composer.load('push', seed=0, object_position=(1.3, 0.6))
    observations = [observation['observation'] for observation in _pushed(env, 28)]
    assert min(observation[5] for observation in observations) > 0.42  # On the table all along.
    angles = np.array([observation[11:14] for observation in observations])
    assert np.abs(np.diff(angles, axis=0)).max() < 0.2
    assert np.ptp(angles[:, 2]) > 0.05  # It did turn.


def test_euler_angles_are_intrinsic_xyz():
    rotations = transform.Rotation.random(200, random_state=0)
    matrices = rotations.as_matrix().reshape(-1, 9)
    expected = rotations.as_euler('XYZ')
    one_by_one = [observation_lib.euler_xyz(matrix.tolist()) for matrix in matrices]
    np.testing.assert_allclose(one_by_one, expected, atol=1e-9)
    np.testing.assert_allclose(observation_lib.euler_xyz_batch(matrices), expected, atol=1e-9)


@pytest.mark.parametrize('middle', [np.pi / 2, -np.pi / 2])
def test_euler_angles_at_the_singularity_give_the_rotation_back(middle):
    angles = (0.0, middle, 0.7)
    matrix = transform.Rotation.from_euler('XYZ', angles).as_matrix()
    found = observation_lib.euler_xyz(matrix.ravel().tolist())
    rebuilt = transform.Rotation.from_euler('XYZ', found).as_matrix()
    np.testing.assert_allclose(rebuilt, matrix, atol=1e-6)
    np.testing.assert_allclose(
        observation_lib.euler_xyz_batch(matrix.reshape(1, 9))[0], found, atol=1e-9
    )
