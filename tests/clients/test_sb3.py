"""Stable-Baselines3: its checker, its vectorized environments, and an agent that learns."""

import csv

import numpy as np
import pytest

pytest.importorskip(
    'stable_baselines3', reason="Stable-Baselines3 is not installed: pip install -e '.[sb3]'"
)

import gymnasium as gym  # noqa: E402
from stable_baselines3 import HerReplayBuffer  # noqa: E402
from stable_baselines3.common import env_checker, vec_env  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer.interfaces.sb3_vec_env import SB3VecEnv  # noqa: E402
from tests import episodes  # noqa: E402

pytestmark = [
    pytest.mark.clients,
    pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning'),
]
_PUSH = 'fetch_composer/FetchPush-v2'


_REACH = 'fetch_composer/FetchReach-v2'  # Whose goals uniform actions achieve at times.


def _vec_env(num_envs: int, env_id: str = _PUSH, **options) -> SB3VecEnv:
    return SB3VecEnv(gym.make_vec(env_id, num_envs=num_envs, **options))


@pytest.mark.parametrize('version', ['v2', 'v4'])
@pytest.mark.filterwarnings('error::UserWarning')
def test_the_checker_is_content(task_name, version):
    name = task_name.title().replace('_', '')
    env_checker.check_env(gym.make(f'fetch_composer/Fetch{name}-{version}').unwrapped)


@pytest.mark.parametrize(('env_id', 'terminates'), [(_PUSH, False), (_REACH, True)])
def test_the_native_batch_is_what_their_own_vector_of_environments_is(env_id, terminates):
    options = {'terminate_on_success': terminates}
    native, terminated = _vec_env(3, env_id, **options), 0
    other = vec_env.DummyVecEnv([lambda: gym.make(env_id, **options)] * 3)
    assert native.observation_space == other.observation_space
    assert native.action_space == other.action_space
    for env in native, other:
        env.seed(4)
    one, another = native.reset(), other.reset()
    for action in episodes.uniform_actions(110, batch_shape=(3,)):
        for name, value in one.items():
            np.testing.assert_allclose(value, another[name], rtol=0, atol=1e-9)
        one, reward, done, infos = native.step(action)
        another, other_reward, other_done, other_infos = other.step(action)
        np.testing.assert_array_equal(reward, other_reward)
        np.testing.assert_array_equal(done, other_done)
        for info, other_info in zip(infos, other_infos, strict=True):
            assert info['is_success'] == other_info['is_success']
            assert info['TimeLimit.truncated'] == other_info['TimeLimit.truncated']
            terminated += 'terminal_observation' in info and not info['TimeLimit.truncated']
            assert ('terminal_observation' in info) == ('terminal_observation' in other_info)
            for name, value in info.get('terminal_observation', {}).items():
                expected = other_info['terminal_observation'][name]
                np.testing.assert_allclose(value, expected, rtol=0, atol=1e-9)
    assert (terminated > 0) == terminates


def test_a_vector_that_starts_episodes_by_itself_is_refused():
    with pytest.raises(ValueError, match='leave autoreset_mode at NEXT_STEP'):
        _vec_env(2, autoreset_mode='SameStep')


def test_hindsight_keeps_the_ends_of_episodes_that_end_at_their_goals():
    env = _vec_env(8, _REACH, terminate_on_success=True)
    buffer = HerReplayBuffer(
        2000, env.observation_space, env.action_space, env, n_envs=8, device='cpu'
    )
    env.seed(0)
    observation = env.reset()
    ended = 0
    for action in episodes.uniform_actions(150, batch_shape=(8,)):
        following, reward, done, infos = env.step(action)
        last = {k: v.copy() for k, v in following.items()}
        for i in np.flatnonzero(done):
            ended += not infos[i]['TimeLimit.truncated']
            for name, value in infos[i]['terminal_observation'].items():
                last[name][i] = value
        buffer.add(observation, last, action, reward, done, infos)
        observation = following
    assert ended > 0
    batch = buffer.sample(2000)
    assert batch.dones.any()
    real = fetch_composer.compute_reward(
        batch.next_observations['achieved_goal'].numpy(),
        batch.observations['desired_goal'].numpy(),
    )
    np.testing.assert_array_equal(batch.rewards.numpy()[:, 0], real)


def test_only_environments_that_are_done_start_anew():
    env = _vec_env(2)
    env.seed(4)
    env.reset()
    ahead = fetch_composer.load('push', seed=9)
    episodes.run(ahead, np.zeros((48, 4)))
    # The first is 48 steps into an episode, the second at its start.
    env.env.unwrapped.set_states([ahead.get_state()], [0])
    actions = episodes.uniform_actions(3, batch_shape=(2,))
    done = []
    for action in actions:
        before, _, each, infos = env.step(action)
        done.append(each.tolist())
        if each[0]:
            moved = infos[0]['terminal_observation']['desired_goal'] - before['desired_goal'][0]
            assert np.abs(moved).max() > 1e-3
            goal = before['desired_goal'][1]
    assert done == [[False, False], [True, False], [False, False]]
    np.testing.assert_array_equal(before['desired_goal'][1], goal)


def test_options_reach_the_next_episode_only():
    env = _vec_env(2)
    env.set_options({'goal': (1.3, 0.8, 0.425)})
    np.testing.assert_array_equal(env.reset()['desired_goal'], [(1.3, 0.8, 0.425)] * 2)
    assert np.abs(env.reset()['desired_goal'] - (1.3, 0.8, 0.425)).max() > 1e-3


def test_attributes_are_common_to_all():
    env = _vec_env(2)
    assert env.get_attr('num_envs') == [2, 2]
    assert env.get_attr('num_envs', indices=[1]) == [2]
    with pytest.raises(ValueError, match='common'):
        env.set_attr('x', 1, indices=[0])


def test_relabelled_transitions_have_the_reward_of_their_new_goal():
    env = _vec_env(4)
    buffer = HerReplayBuffer(
        1000, env.observation_space, env.action_space, env, n_envs=4, device='cpu'
    )
    observation = env.reset()
    for action in episodes.uniform_actions(50, batch_shape=(4,)):
        following, reward, done, infos = env.step(action)
        last = {k: v.copy() for k, v in following.items()}
        for i in np.flatnonzero(done):
            for name, value in infos[i]['terminal_observation'].items():
                last[name][i] = value
        buffer.add(observation, last, action, reward, done, infos)
        observation = following
    batch = buffer.sample(500)
    expected = fetch_composer.compute_reward(
        batch.next_observations['achieved_goal'].numpy(),
        batch.observations['desired_goal'].numpy(),
        'sparse',
    )
    np.testing.assert_array_equal(batch.rewards.numpy()[:, 0], expected)
    assert not batch.dones.any(), 'the tasks are continuing: episodes are truncated'
    assert (expected == 0).any() and (expected == -1).any()


@pytest.mark.parametrize('library', ['stable_baselines3', 'sbx'])
def test_the_example_learns_to_reach(run_example, tmp_path, library):
    """Takes some two minutes each."""
    pytest.importorskip(library, reason="needs pip install 'fetch_composer[sbx]'")
    run_example('sb3_her.py', f'--library={library}', '--output_dir', str(tmp_path))
    with open(tmp_path / 'FetchReach-v2.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]['success']) >= 0.95, rows
    assert (tmp_path / 'FetchReach-v2.png').stat().st_size > 10_000
    assert (tmp_path / 'FetchReach-v2.zip').exists()
