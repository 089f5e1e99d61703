"""Ways to act: what each number of an action does, and that every face knows of it."""

import dataclasses
import functools
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from absl.testing import absltest
from dm_control.composer.variation import distributions
from dm_env import test_utils
from gymnasium.utils import env_checker
from scipy.spatial.transform import Rotation

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer import flags
from fetch_composer.tasks.state import State

_SIZES = {'displacement': 4, 'displacement+yaw': 5, 'displacement+rotation': 7, 'joints': 8}
_CHOSEN = tuple(each for each in _SIZES if each != 'displacement')
_FREE, _LOCKED = 'pick_and_place', 'push'


@pytest.fixture(params=_SIZES)
def mode(request) -> str:
    return request.param


@functools.cache
def _env(mode, task=_LOCKED):
    """Returns an environment that several tests reset."""
    return fetch_composer.load(task, seed=0, action_mode=mode, max_episode_steps=None)


def _action(size: int, values=()) -> np.ndarray:
    action = np.zeros(size, np.float32)
    for index, value in dict(values).items():
        action[index] = value
    return action


def _random_actions(mode: str, *shape: int) -> np.ndarray:
    return np.random.default_rng(1).uniform(-1.2, 1.2, (*shape, _SIZES[mode])).astype(np.float32)


def _orientation(env) -> Rotation:
    quaternion = env.physics.bind(env.task.scene.gripper.gripper_link).xquat
    return Rotation.from_quat(quaternion, scalar_first=True)


def _turned_by(env, start: Rotation) -> np.ndarray:
    """Returns the rotation vector, in rad about the world's axes, from a start until now."""
    return (_orientation(env) * start.inv()).as_rotvec()


def _joints(env) -> np.ndarray:
    return np.array(env.physics.bind(env.task.scene.arm.joints).qpos)


def test_specs_and_spaces_have_the_numbers_of_the_mode_and_the_gripper_last(mode):
    shape = (_SIZES[mode],)
    spec = _env(mode).action_spec()
    assert (spec.shape, spec.dtype, spec.minimum, spec.maximum) == (shape, np.float32, -1, 1)
    names = spec.name.split('\t')
    assert len(names) == len(set(names)) == _SIZES[mode]
    assert names[-1] == 'gripper'
    batch = fetch_composer.BatchEnvironment('reach', 2, seed=0, action_mode=mode)
    assert batch.single_action_spec() == spec
    assert batch.action_spec().shape == (2, *shape)
    envs = gym.make_vec('fetch_composer/FetchReach-v2', num_envs=2, action_mode=mode)
    assert envs.single_action_space == gym.spaces.Box(-1, 1, shape, np.float32)
    envs.reset(seed=0)
    envs.step(envs.action_space.sample())


@pytest.mark.parametrize('task', [_FREE, _LOCKED])
def test_zero_holds_the_gripper(mode, task):
    env = _env(mode, task)
    start = env.reset().observation['observation'][:3]
    orientation = _orientation(env)
    for _ in range(50):
        observation = env.step(_action(_SIZES[mode])).observation['observation']
        assert np.linalg.norm(observation[:3] - start) < 1e-3
        assert np.linalg.norm(_turned_by(env, orientation)) < 1e-2


def test_the_last_number_moves_the_fingers(mode):
    env = _env(mode, _FREE)
    for step in (1, -1):
        env.reset()
        for _ in range(5):
            observation = env.step(_action(_SIZES[mode], {-1: step})).observation['observation']
        np.testing.assert_allclose(observation[9:11], 0.05 if step > 0 else 0, atol=3e-3)


@pytest.mark.parametrize('steps', [1, 5])
@pytest.mark.parametrize(
    ('mode', 'index', 'axis'),
    [
        ('displacement+yaw', 3, (0, 0, 1)),
        ('displacement+rotation', 3, (1, 0, 0)),
        ('displacement+rotation', 4, (0, 1, 0)),
        ('displacement+rotation', 5, (0, 0, 1)),
    ],
)
def test_a_rotation_turns_the_gripper_about_its_axis_by_a_tenth_of_a_radian(
    mode, index, axis, steps
):
    env = _env(mode)
    for sign in (1, -1):
        env.reset()
        start = _orientation(env)
        for step in range(steps + 8):
            env.step(_action(_SIZES[mode], {index: sign if step < steps else 0}))
        turned = _turned_by(env, start)
        np.testing.assert_allclose(turned, sign * 0.1 * steps * np.array(axis), atol=3e-3)


def test_rotations_about_several_axes_are_one_rotation_vector():
    env = _env('displacement+rotation')
    env.reset()
    start = _orientation(env)
    vector = np.array((0.8, -0.5, 1.0))
    for step in range(12):
        env.step((0, 0, 0.3, *(vector if step < 4 else 0 * vector), 0))
    np.testing.assert_allclose(_turned_by(env, start), 0.4 * vector, atol=5e-3)


def test_yaw_leaves_the_gripper_pointing_down_however_far_it_turns():
    env = _env('displacement+yaw')
    env.reset()
    for _ in range(80):  # More than a whole turn.
        env.step(_action(5, {3: 1}))
        assert _orientation(env).as_matrix()[2, 0] < -0.999


def test_a_displacement_is_that_of_the_default_mode_while_nothing_turns():
    expected = _env('displacement')
    expected.reset()
    for mode in _CHOSEN[:2]:
        env = _env(mode)
        env.set_state(dataclasses.replace(expected.get_state(), action_mode=mode))
    for x, y, z in np.random.default_rng(0).uniform(-1, 1, (20, 3)):
        displaced = {0: x, 1: y, 2: z}
        observation = expected.step(_action(4, displaced)).observation
        for mode in _CHOSEN[:2]:
            other = _env(mode).step(_action(_SIZES[mode], displaced)).observation
            np.testing.assert_array_equal(other['observation'], observation['observation'])


def test_a_gripper_that_cannot_turn_further_turns_back_at_once():
    env = _env('displacement+rotation')
    env.reset()
    for _ in range(60):  # Six radians, of which the wrist can do less than two.
        env.step(_action(7, {4: -1}))
        assert np.abs(env.physics.data.qvel).max() < 10
    stopped = _orientation(env)
    for _ in range(6):
        env.step(_action(7, {4: 1}))
    assert _turned_by(env, stopped)[1] > 0.1


@pytest.mark.parametrize('sign', [1, -1])
def test_a_joint_moves_by_what_is_asked_and_alone_and_does_not_swing(sign):
    env = _env('joints')
    for joint in range(7):
        env.reset()
        start, asked = _joints(env), np.zeros(7)
        asked[joint] = sign * 0.1
        for step in range(20):
            env.step(_action(8, {joint: sign if step < 2 else 0}))
            moved = _joints(env) - start
            assert sign * moved[joint] < 0.101
            np.testing.assert_allclose(np.delete(moved, joint), 0, atol=0.01)  # They are shaken.
        np.testing.assert_allclose(moved, asked, atol=1e-3)


def test_a_joint_at_the_end_of_its_range_stays_there_and_comes_back_at_once():
    env = _env('joints')
    env.reset()
    _, highest = env.physics.bind(env.task.scene.arm.joints[5]).range
    for _ in range(40):
        env.step(_action(8, {5: 1}))
    assert _joints(env)[5] == pytest.approx(highest, abs=0.01)
    for _ in range(10):
        env.step(_action(8, {5: -1}))
    assert _joints(env)[5] < highest - 0.2


@pytest.mark.parametrize('mode', _CHOSEN)
@pytest.mark.parametrize(('task', 'num_envs'), [(_FREE, 3), (_LOCKED, 1)])
def test_rows_of_a_batch_are_single_environments_to_the_bit(mode, num_envs, task):
    options = {'action_mode': mode, 'max_episode_steps': 30}
    batch = fetch_composer.BatchEnvironment(task, num_envs, seed=5, **options)
    singles = [fetch_composer.load(task, seed=5 + i, **options) for i in range(num_envs)]
    batch.reset()
    for single in singles:
        single.reset()
    for step, actions in enumerate(_random_actions(mode, 45, num_envs)):
        actions[0, -2] = 1  # Until it can no further.
        if step == 10:
            batch.reset(ids=[0])
            singles[0].reset()
        batch.step(actions)
        for single, action, state in zip(singles, actions, batch.get_states(), strict=True):
            single.step(action)
            np.testing.assert_array_equal(state.physics, single.get_state().physics)


_OTHER_PROCESS = """
import sys
import numpy as np
import fetch_composer
from fetch_composer.tasks.state import State
for path in sys.argv[1:]:
    state = State.load(path)
    env = fetch_composer.load('push', seed=77, action_mode=state.action_mode)
    env.set_state(state)
    for action in np.load(path + '.npy'):
        env.step(action)
    print(env.get_state().physics.tobytes().hex())
"""


def test_a_state_goes_on_to_the_bit_here_in_a_batch_and_in_another_process(tmp_path):
    paths, expected = [], []
    for mode in _CHOSEN:
        env = fetch_composer.load('push', seed=0, action_mode=mode)
        env.reset()
        for action in _random_actions(mode, 12):
            env.step(action)
        state, following = env.get_state(), _random_actions(mode, 20)[::-1]
        paths.append(str(tmp_path / mode))
        state.save(paths[-1])
        np.save(f'{paths[-1]}.npy', following)
        batch = fetch_composer.BatchEnvironment('push', 2, seed=9, action_mode=mode)
        batch.reset()
        batch.set_states([State.load(paths[-1])], [1])
        for action in following:
            env.step(action)
            batch.step(np.tile(action, (2, 1)))
        ends = [env.get_state().physics, batch.get_states([1])[0].physics]
        np.testing.assert_array_equal(*ends)
        expected.append(ends[0].tobytes().hex())
    command = [sys.executable, '-c', _OTHER_PROCESS, *paths]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.stdout.split() == expected, result.stderr


def test_a_state_of_another_mode_is_refused():
    for mode in _SIZES:
        _env(mode).reset()
    for mode, other in zip(_SIZES, (*_CHOSEN, 'displacement'), strict=True):
        kept = _env(mode).get_state().physics
        message = rf"differs in action_mode \('{other}', not '{mode}'\)".replace('+', r'\+')
        with pytest.raises(ValueError, match=message):
            _env(mode).set_state(_env(other).get_state())
        np.testing.assert_array_equal(_env(mode).get_state().physics, kept)


def test_a_bad_action_is_named_and_changes_nothing(mode):
    env, size = _env(mode), _SIZES[mode]
    env.reset()
    env.step(np.full(size, 0.5))
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0, action_mode=mode)
    batch.reset()
    kept = [env.get_state(), *batch.get_states()]
    for number in (np.nan, np.inf):
        with pytest.raises(ValueError, match='must be finite'):
            env.step(_action(size, {size - 2: number}))
        with pytest.raises(ValueError, match=r'must be finite; rows \[1\]'):
            batch.step([_action(size), _action(size, {size - 2: number})])
    with pytest.raises(ValueError, match=rf'shape \({size},\) is needed, got \(3,\).*, gripper\.'):
        env.step(np.zeros(3))
    with pytest.raises(ValueError, match=rf'shape \(2, {size}\) is needed'):
        batch.step(np.zeros((2, size + 1)))
    for one, other in zip(kept, [env.get_state(), *batch.get_states()], strict=True):
        np.testing.assert_array_equal(one.physics, other.physics)


def test_modes_that_there_are_not_are_refused():
    with pytest.raises(ValueError, match=r'valid are displacement, .*, joints\.'):
        fetch_composer.load('push', action_mode='joint')
    with pytest.raises(ValueError, match="'gymnasium_robotics' has no action_mode 'joints'; valid"):
        gym.make('fetch_composer/FetchPush-v4', action_mode='joints')


def test_policies_follow_the_spec_or_say_that_they_do_not(mode):
    env = _env(mode)
    observation = env.reset().observation
    for name in ('random', 'zero'):
        env.action_spec().validate(policies.load(name, env, seed=0)(observation))
    if mode != 'displacement':
        for name in ('expert', 'trained'):
            with pytest.raises(ValueError, match=f"{name} is for the action_mode 'displacement'"):
                policies.load(name, env)


@pytest.mark.parametrize('mode', _CHOSEN)
def test_variations_differ_between_episodes_in_which_zero_holds(mode):
    variations = {
        'object_mass': distributions.Uniform(1.0, 3.0),
        'gripper_offset': distributions.Uniform((-0.05,) * 3, (0.05,) * 3),
    }
    env = fetch_composer.load('push', seed=0, action_mode=mode, variations=variations)
    starts = []
    for _ in range(2):
        starts.append(env.reset().observation['observation'][:3])
        for _ in range(20):
            observation = env.step(_action(_SIZES[mode])).observation['observation']
        np.testing.assert_allclose(observation[:3], starts[-1], atol=1e-3)
    assert np.abs(starts[0] - starts[1]).max() > 5e-3


def test_the_explorer_replays_an_episode_in_its_mode(mode):
    options = flags.make_options({'action_mode': mode, 'policy': ['zero']})
    command = flags.replay_command(options, ['zero'], seed=3)
    assert (f'--action_mode={mode}' in command) == (mode != 'displacement')


@pytest.mark.parametrize('mode', _CHOSEN)
def test_gymnasiums_own_checker_is_content(mode):
    env_checker.check_env(
        gym.make('fetch_composer/FetchReach-v2', action_mode=mode).unwrapped, skip_render_check=True
    )


def _mixin_test(mode):
    class Test(test_utils.EnvironmentTestMixin, absltest.TestCase):
        def make_object_under_test(self):
            return fetch_composer.load('reach', seed=0, action_mode=mode, max_episode_steps=10)

        def make_action_sequence(self):
            yield from _random_actions(mode, 25).clip(-1, 1)  # Past the end of two episodes.

    Test.__name__ = Test.__qualname__ = f'TestDmEnv_{mode}'
    return Test


for _mode in _CHOSEN:
    _test = _mixin_test(_mode)
    globals()[_test.__name__] = _test
del _test
