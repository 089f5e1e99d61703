"""The Gymnasium face: spaces, seeds, options, vector forms."""

import functools
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils import env_checker

import fetch_composer
from fetch_composer.interfaces import gymnasium_env, gymnasium_vector
from tests import episodes

pytestmark = pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning')

_IDS = tuple(
    f'fetch_composer/Fetch{name}{suffix}-{version}'
    for name in ('PickAndPlace', 'Push', 'Reach', 'Slide')
    for suffix in ('', 'Dense')
    for version in ('v2', 'v4')
)


# For tests that reset and step it, and no more.
_shared = functools.cache(gym.make)


@pytest.fixture(params=_IDS)
def env_id(request) -> str:
    return request.param


def test_all_ids_are_registered():
    assert set(_IDS) <= set(gym.registry)
    gym.register_envs(fetch_composer)


def test_gymnasiums_checker_is_content(env_id):
    env = gym.make(env_id)
    # Rendering is looked at below: the checker would open a window.
    env_checker.check_env(env.unwrapped, skip_render_check=True)


def test_spaces_are_those_of_gymnasium_robotics(env_id):
    env = _shared(env_id)
    size = 10 if 'Reach' in env_id else 25
    assert env.action_space == spaces.Box(-1.0, 1.0, (4,), np.float32)
    unbounded = {'observation': size, 'achieved_goal': 3, 'desired_goal': 3}
    assert env.observation_space == spaces.Dict(
        {name: spaces.Box(-np.inf, np.inf, (n,), np.float64) for name, n in unbounded.items()}
    )
    assert env.metadata['render_fps'] == 25


def test_ids_choose_convention_and_reward(env_id):
    task = _shared(env_id).unwrapped.dm_env.task
    assert task.convention.name == ('gymnasium_robotics' if env_id.endswith('v4') else 'documented')
    assert task.options.reward_type == ('dense' if 'Dense' in env_id else 'sparse')


def test_episodes_are_truncated_and_never_terminated(env_id):
    for options, expected in (({}, 50), ({'max_episode_steps': 7}, 7)):
        env = _shared(env_id, **options)
        env.reset(seed=0)
        for step in range(1, expected + 1):
            *_, terminated, truncated, info = env.step(env.action_space.sample())
            assert not terminated
            assert truncated == (step == expected)
            assert isinstance(info['is_success'], np.float32)
            assert info['is_success'] in (0.0, 1.0)


def test_a_seed_starts_as_it_does_in_dm_env(task_name, convention):
    version = 'v4' if convention == 'gymnasium_robotics' else 'v2'
    camel = ''.join(word.capitalize() for word in task_name.split('_'))
    env = _shared(f'fetch_composer/Fetch{camel}-{version}')
    single = episodes.shared(task_name, 12, convention=convention)
    for episode in range(3):
        observation, _ = env.reset(seed=12 if episode == 0 else None)
        expected = single.reset().observation
        for action in episodes.uniform_actions(5):
            for name, value in expected.items():
                np.testing.assert_array_equal(observation[name], value)
            observation, reward, *_ = env.step(action)
            time_step = single.step(action)
            expected = time_step.observation
            assert reward == time_step.reward


def test_rewards_can_be_recomputed_for_relabelled_goals(env_id):
    env = _shared(env_id).unwrapped
    env.reset(seed=0)
    achieved, desired, rewards = [], [], []
    for action in episodes.uniform_actions(20):
        observation, reward, *_, info = env.step(action)
        achieved.append(observation['achieved_goal'])
        desired.append(observation['desired_goal'])
        rewards.append(reward)
    batch = env.compute_reward(np.array(achieved), np.array(desired), [{}] * 20)
    np.testing.assert_allclose(batch, rewards, atol=1e-12)
    relabelled = env.compute_reward(np.array(achieved), np.array(achieved), info)
    np.testing.assert_array_equal(relabelled, 0)
    assert env.compute_terminated(achieved[0], desired[0], info) is False
    assert env.compute_truncated(achieved[0], desired[0], info) is False


def test_options_give_start_and_goal_of_one_episode():
    env = gym.make('fetch_composer/FetchPush-v2')
    options = {'object_position': (1.2, 0.6), 'goal': (1.3, 0.8, 0.425)}
    observation, _ = env.reset(seed=0, options=options)
    np.testing.assert_allclose(observation['achieved_goal'][:2], options['object_position'])
    np.testing.assert_array_equal(observation['desired_goal'], options['goal'])
    observation, _ = env.reset()
    assert np.abs(observation['desired_goal'] - options['goal']).max() > 1e-3


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'start': (1.2, 0.6)}, 'valid are object_position, goal'),
        ({'object_position': (0, 0)}, 'off the table'),
        ({'goal': (np.nan, 0.75, 0.42)}, '3 finite numbers'),
    ],
)
def test_bad_options_leave_the_environment_as_it_was(options, message):
    env, other = (gym.make('fetch_composer/FetchPush-v2') for _ in range(2))
    env.reset(seed=5)
    other.reset(seed=5)
    with pytest.raises(ValueError, match=message):
        env.reset(seed=6, options=options)
    one, another = env.reset()[0], other.reset()[0]
    np.testing.assert_array_equal(one['desired_goal'], another['desired_goal'])


@pytest.mark.parametrize('action', [np.full(4, np.nan), np.zeros(3)])
def test_bad_actions_are_refused(action):
    env = gym.make('fetch_composer/FetchPush-v2', disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match='action'):
        env.step(action)


def test_a_copy_by_pickle_is_the_same_environment():
    env = gym.make('fetch_composer/FetchSlideDense-v4', goal=(1.5, 0.8, 0.42)).unwrapped
    copy = pickle.loads(pickle.dumps(env))
    one, another = env.reset(seed=1)[0], copy.reset(seed=1)[0]
    for name in one:
        np.testing.assert_array_equal(one[name], another[name])


def _run_vector(env, actions):
    observation, _ = env.reset(seed=3)
    results = [(observation, None, None, None)]
    results += [env.step(action)[:4] for action in actions]
    env.close()
    return results


@pytest.mark.parametrize('mode', ['sync', 'async'])
def test_the_native_batch_is_gymnasiums_own_vector_of_environments(mode):
    actions = episodes.uniform_actions(60, batch_shape=(3,))
    for env_id in ('fetch_composer/FetchPush-v2', 'fetch_composer/FetchPickAndPlaceDense-v4'):
        native = gym.make_vec(env_id, num_envs=3)
        assert isinstance(native, gymnasium_vector.FetchVectorEnv)
        other = gym.make_vec(env_id, num_envs=3, vectorization_mode=mode)
        assert native.single_observation_space == other.single_observation_space
        assert native.observation_space == other.observation_space
        assert native.action_space == other.action_space
        assert native.metadata['autoreset_mode'] == other.metadata['autoreset_mode']
        for one, another in zip(
            _run_vector(native, actions), _run_vector(other, actions), strict=True
        ):
            for name, value in one[0].items():
                np.testing.assert_allclose(value, another[0][name], rtol=0, atol=1e-9)
            for mine, theirs in zip(one[1:], another[1:], strict=True):
                if mine is not None:
                    np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_the_vector_form_takes_its_length_of_episode_options_and_info():
    env = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=2, max_episode_steps=3)
    observation, info = env.reset(seed=0, options={'goal': (1.3, 0.8, 0.425)})
    np.testing.assert_array_equal(observation['desired_goal'], [(1.3, 0.8, 0.425)] * 2)
    truncations = [env.step(np.zeros((2, 4), np.float32))[3].all() for _ in range(4)]
    assert truncations == [False, False, True, False]
    assert info['is_success'].shape == (2,)
    with pytest.raises(ValueError, match='valid are object_position, goal'):
        env.reset(options={'x': 1})


def test_code_written_against_gymnasium_robotics_finds_what_it_looks_for(env_id):
    env = gym.make(env_id).unwrapped
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(env.goal, observation['desired_goal'])
    assert env.distance_threshold == 0.05
    assert env.reward_type == ('dense' if 'Dense' in env_id else 'sparse')
    assert env.dt == pytest.approx(0.04)
    before = env.data.qpos.copy()
    env.step(np.ones(4, np.float32))
    assert env.model.nq == len(before) and np.abs(env.data.qpos - before).max() > 1e-4


def test_made_by_hand_neither_form_truncates_unless_asked_to():
    for limit, expected in ((None, False), (4, True)):
        options = {} if limit is None else {'max_episode_steps': limit}
        single = gymnasium_env.FetchEnv('push', **options)
        vector = gymnasium_vector.FetchVectorEnv('push', 2, **options)
        single.reset(seed=0)
        vector.reset(seed=0)
        steps = limit or 60
        one = [single.step(np.zeros(4, np.float32))[3] for _ in range(steps)]
        many = [vector.step(np.zeros((2, 4), np.float32))[3].all() for _ in range(steps)]
        assert one == many == [False] * (steps - 1) + [expected]


def test_some_of_a_vector_are_reset_and_the_others_go_on():
    env = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=3)
    env.reset(seed=0)
    for action in episodes.uniform_actions(3, batch_shape=(3,)):
        before = env.step(action)[0]
    mask = np.array([False, True, False])
    after, _ = env.reset(options={'reset_mask': mask, 'goal': (1.3, 0.8, 0.425)})
    for name in before:
        np.testing.assert_array_equal(after[name][~mask], before[name][~mask])
    np.testing.assert_array_equal(after['desired_goal'][1], (1.3, 0.8, 0.425))


def test_after_close_every_call_says_that_it_is_closed():
    single = gym.make('fetch_composer/FetchPush-v2').unwrapped
    vector = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=2)
    for env, action in ((single, np.zeros(4)), (vector, np.zeros((2, 4)))):
        env.reset(seed=0)
        env.close()
        env.close()
        for call in env.reset, lambda env=env, action=action: env.step(action):
            with pytest.raises(RuntimeError, match='closed'):
                call()
    for name in ('model', 'data', 'goal', 'dt'):
        with pytest.raises(RuntimeError, match='closed'):
            getattr(single, name)


def test_what_has_ended_or_not_begun_is_not_stepped():
    env = gymnasium_env.FetchEnv('push', max_episode_steps=2)
    action = np.zeros(4, np.float32)
    for _ in range(2):
        with pytest.raises(RuntimeError, match=r'call reset\(\) first'):
            env.step(action)
        env.reset(seed=0)
        assert [env.step(action)[3] for _ in range(2)] == [False, True]
