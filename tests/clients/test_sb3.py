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
from fetch_composer.interfaces.sb3_replay_buffer import MovedHerReplayBuffer  # noqa: E402
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


def _buffer(env, size: int, kind: type = HerReplayBuffer, **options) -> HerReplayBuffer:
    spaces = env.observation_space, env.action_space
    return kind(size, *spaces, env, n_envs=env.num_envs, device='cpu', **options)


def _fill(buffer, env, policy, steps: int) -> int:
    """Keeps what a policy of observations does; returns how many episodes ended at their goals."""
    env.seed(0)
    observation, ended = env.reset(), 0
    for _ in range(steps):
        action = policy(observation)
        following, reward, done, infos = env.step(action)
        last = {k: v.copy() for k, v in following.items()}
        for i in np.flatnonzero(done):
            ended += not infos[i]['TimeLimit.truncated']
            for name, value in infos[i]['terminal_observation'].items():
                last[name][i] = value
        buffer.add(observation, last, action, reward, done, infos)
        observation = following
    return ended


def _uniform(env):
    generator = np.random.default_rng(0)
    return lambda observation: generator.uniform(-1, 1, (env.num_envs, 4)).astype(np.float32)


def _one_in_four_pushes(observation) -> np.ndarray:
    actions = np.zeros((len(observation['observation']), 4), np.float32)
    for i in range(0, len(actions), 4):
        actions[i] = episodes.push_through({k: v[i] for k, v in observation.items()})
    return actions


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
    buffer = _buffer(env, 2000)
    ended = _fill(buffer, env, _uniform(env), 150)
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
    buffer = _buffer(env, 1000)
    _fill(buffer, env, _uniform(env), 50)
    batch = buffer.sample(500)
    expected = fetch_composer.compute_reward(
        batch.next_observations['achieved_goal'].numpy(),
        batch.observations['desired_goal'].numpy(),
        'sparse',
    )
    np.testing.assert_array_equal(batch.rewards.numpy()[:, 0], expected)
    assert not batch.dones.any(), 'the tasks are continuing: episodes are truncated'
    assert (expected == 0).any() and (expected == -1).any()


@pytest.mark.parametrize('share', [0, 0.5, 1])
def test_a_share_of_transitions_is_from_episodes_that_moved_the_object(share):
    env = _vec_env(4)
    buffer = _buffer(env, 1000, MovedHerReplayBuffer, moved_share=share)
    _fill(buffer, env, _one_in_four_pushes, 50)
    pushed = buffer.sample(4000).actions.any(axis=1)  # The others never act.
    assert abs(float(pushed.float().mean()) - (share + (1 - share) / 4)) < 0.05


def test_transitions_of_moved_objects_have_goals_of_both_kinds_in_every_part_of_a_draw():
    env = _vec_env(8)
    buffer = _buffer(env, 4000, MovedHerReplayBuffer)
    _fill(buffer, env, _one_in_four_pushes, 100)
    batch = buffer.sample(8 * 256)
    np.testing.assert_array_equal(
        batch.rewards.numpy()[:, 0],
        fetch_composer.compute_reward(
            batch.next_observations['achieved_goal'].numpy(),
            batch.observations['desired_goal'].numpy(),
        ),
    )
    own = np.unique(buffer.observations['desired_goal'].reshape(-1, 3), axis=0)
    for part in np.split(batch.observations['desired_goal'].numpy(), 8):
        are_own = (part[:, None] == own).all(axis=2).any(axis=1)
        assert 0.05 < are_own.mean() < 0.4  # A fifth, with `n_sampled_goal` of 4.


def test_episodes_that_are_overwritten_are_not_drawn():
    env = _vec_env(4)
    buffer = _buffer(env, 4 * 120, MovedHerReplayBuffer, moved_share=1)
    _fill(buffer, env, _one_in_four_pushes, 100)
    before = buffer.sample(200)
    assert before.actions.any(axis=1).all()
    still = np.zeros((4, 4), np.float32)
    _fill(buffer, env, lambda observation: still, 30)  # Over the beginning of the first episode.
    drawn = buffer.sample(200).observations['observation'].numpy()
    second = buffer.observations['observation'][50:100, 0]
    assert (drawn[:, np.newaxis] == second).all(axis=2).any(axis=1).all()
    _fill(buffer, env, lambda observation: still, 130)
    assert not buffer.sample(200).actions.any()


def test_without_a_moved_object_transitions_are_drawn_from_all_episodes():
    env = _vec_env(2)
    buffer = _buffer(env, 200, MovedHerReplayBuffer, moved_share=1)
    _fill(buffer, env, lambda observation: np.ones((2, 4), np.float32), 50)
    assert len(buffer.sample(64).actions) == 64


@pytest.mark.parametrize('share', [-0.1, 1.1, np.nan])
def test_a_share_that_is_none_is_refused(share):
    with pytest.raises(ValueError, match='moved_share must be from 0 to 1'):
        _buffer(_vec_env(2), 100, MovedHerReplayBuffer, moved_share=share)


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
