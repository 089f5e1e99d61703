"""`terminate_on_success`: an episode ends at its goal, with discount 0, in every form."""

import dm_env
import gymnasium as gym
import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.episodes import episode as episode_lib
from fetch_composer.explorer.results import store, summary
from fetch_composer.tasks import TaskOptions
from tests import episodes

pytestmark = pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning')


def _episode(env, policy):
    """Returns the time steps of the next episode."""
    policy.reset()
    time_steps = [env.reset()]
    while not time_steps[-1].last():
        time_steps.append(env.step(policy(time_steps[-1].observation)))
    return time_steps


def test_an_episode_ends_with_the_first_step_at_the_goal(task_name, convention):
    env, whole = (
        episodes.shared(task_name, 3, convention=convention, terminate_on_success=each)
        for each in (True, False)
    )
    policy = policies.load('expert', env)
    ending, full = _episode(env, policy), _episode(whole, policy)
    (last,) = ending[-1:]
    assert 1 < len(ending) < len(full) == 51
    assert (last.step_type, last.reward, last.discount) == (dm_env.StepType.LAST, 0.0, 0.0)
    assert env.task.is_success() and env.task.is_terminated() and not env.task.is_truncated()
    assert [each.discount for each in ending[1:-1]] == [1.0] * (len(ending) - 2)
    for one, other in zip(ending, full, strict=False):
        np.testing.assert_array_equal(
            one.observation['observation'], other.observation['observation']
        )
    assert env.step(np.zeros(4)).first()


def test_rows_of_a_batch_end_each_at_its_own_goal(task_name, convention):
    options = {'convention': convention, 'terminate_on_success': True, 'max_episode_steps': 12}
    # Where the object of the first one starts; the gripper gets there in some episodes.
    first = episodes.shared(task_name, convention=convention).reset().observation
    options['goal'] = first['achieved_goal'] + (0.035 if task_name == 'reach' else 0.0)
    batch = fetch_composer.BatchEnvironment(task_name, 2, seed=0, **options)
    singles = [fetch_composer.load(task_name, seed=i, **options) for i in range(2)]
    batch.reset()
    for single in singles:
        single.reset()
    ended = set()
    for actions in episodes.uniform_actions(28, batch_shape=(2,)):
        time_step = batch.step(actions)
        expected = [single.step(action) for single, action in zip(singles, actions, strict=True)]
        assert time_step.step_type.tolist() == [each.step_type for each in expected]
        assert time_step.reward.tolist() == [each.reward or 0 for each in expected]
        for discount, each in zip(time_step.discount, expected, strict=True):
            assert discount == (1 if each.first() else each.discount)
            ended |= {discount} if each.last() else set()
    assert ended == {0.0, 1.0}


@pytest.mark.parametrize('num_envs', [1, 3])
def test_a_state_goes_on_to_the_same_end(num_envs):
    options = {'terminate_on_success': True}
    env = fetch_composer.load('reach', seed=1, **options)
    time_steps = _episode(env, policies.load('expert', env))
    over = env.get_state()
    assert over.is_over
    batch = fetch_composer.BatchEnvironment('reach', num_envs, seed=9, **options)
    batch.set_states([over] * num_envs)
    following = batch.step(np.zeros((num_envs, 4)))
    first = env.step(np.zeros(4))
    assert first.first() and (following.step_type == dm_env.StepType.FIRST).all()
    for goal in following.observation['desired_goal']:
        np.testing.assert_array_equal(goal, first.observation['desired_goal'])
    assert time_steps[-1].discount == 0


def test_gymnasium_reports_that_it_is_terminated():
    env = gym.make('fetch_composer/FetchReach-v2', terminate_on_success=True)
    observation, _ = env.reset(seed=0)
    policy = policies.load('expert', env.unwrapped.dm_env)
    terminated = False
    while not terminated:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
    assert reward == 0 and not truncated and info['is_success'] == 1
    goals = observation['achieved_goal'], observation['desired_goal']
    assert env.unwrapped.compute_terminated(*goals, info)
    far = (goals[0] + 1, goals[1])
    assert not env.unwrapped.compute_terminated(*far, info)
    both = np.stack([goals[0], far[0]]), np.stack([goals[1]] * 2)
    assert env.unwrapped.compute_terminated(*both, {}).tolist() == [True, False]


@pytest.mark.parametrize('goal', [(1.3, 0.6, 0.425), (1.2, 0.9, 0.425)], ids=['at', 'far'])
def test_an_episode_whose_last_step_is_at_the_goal_is_terminated_and_truncated(goal):
    options = {'terminate_on_success': True, 'max_episode_steps': 1}
    start = {'object_position': (1.3, 0.6), 'goal': goal}
    reached = goal[1] == 0.6
    wrapped = gym.make('fetch_composer/FetchPush-v2', **options, **start)
    native = gym.make_vec('fetch_composer/FetchPush-v2', 2, **options, **start)
    for env, shape in ((wrapped, (4,)), (native, (2, 4))):
        env.reset(seed=0)
        _, _, terminated, truncated, _ = env.step(np.zeros(shape, np.float32))
        assert np.all(terminated == reached) and np.all(truncated)


@pytest.mark.parametrize('value', [1, 'yes', None])
def test_anything_but_a_boolean_is_refused(value):
    with pytest.raises(ValueError, match='terminate_on_success must be True or False'):
        fetch_composer.load('push', terminate_on_success=value)


@pytest.fixture(scope='module', params=['expert', 'random'])
def explored(request):
    """Returns options and episodes of the explorer, which end at different times."""
    options = batch_rollout.EpisodeOptions(
        'push', request.param, TaskOptions(terminate_on_success=True, max_episode_steps=30)
    )
    return options, batch_rollout.run_episodes(options, range(12), num_envs=12)


def test_explored_episodes_are_those_of_single_environments(explored):
    options, found = explored
    assert len({each.steps for each in found}) > 1
    env = fetch_composer.load('push', **options.task_kwargs)
    # Other widths, so that rows wait for others in other company.
    beside = batch_rollout.run_episodes(options, range(12), num_envs=5)
    for one, other in zip(found, beside, strict=True):
        alone = episodes.record(env, options.policy, one.seed)
        for name in ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward'):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
            np.testing.assert_allclose(getattr(one, name), getattr(alone, name), atol=1e-9)
        assert one.is_success == (one.reward[-1] == 0) and not (one.reward[:-1] == 0).any()
        assert one.is_success or one.steps == 30


def test_figures_of_episodes_that_ended_early_are_those_of_their_ends(explored):
    _, found = explored
    figures = summary.summarize(found)
    assert figures['success_rate'] == np.mean([each.reward[-1] == 0 for each in found])
    assert [each['steps'] for each in figures['episodes']] == [each.steps for each in found]
    arrays = episode_lib.stack(found)
    for row, each in enumerate(found):
        steps = arrays['steps'][row]
        np.testing.assert_array_equal(arrays['reward'][row][:steps], each.reward)
        assert np.isnan(arrays['reward'][row][steps:]).all()
        assert np.isnan(arrays['distance'][row][steps + 1 :]).all()


def test_episodes_of_different_lengths_are_kept_as_they_are(explored, tmp_path):
    _, found = explored
    kept = store.Store(tmp_path, {})
    kept.add('1_policy', found)
    for one, other in zip(kept.episodes('1_policy', range(12)), found, strict=True):
        assert one.seed == other.seed and one.step_seconds == other.step_seconds
        for name in ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward'):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
            assert getattr(one, name).dtype == getattr(other, name).dtype
    kept.close()


def test_a_policy_is_not_asked_once_its_episode_has_ended():
    options = batch_rollout.EpisodeOptions(
        'push', 'expert', TaskOptions(terminate_on_success=True, max_episode_steps=30)
    )
    env = fetch_composer.load('push', **options.task_kwargs)
    make, asked = policies.factory('expert', policies.PolicyContext.of(env)), {}

    def make_counting(seed):
        policy = make(seed)

        class Counting:
            def reset(self):
                policy.reset()
                asked[seed] = 0

            def __call__(self, observation):
                asked[seed] += 1
                return policy(observation)

        return Counting()

    with batch_rollout.BatchRollout(options, 6, make_policy=make_counting) as batch:
        (found,) = batch.run(range(6))
    assert asked == {each.seed: each.steps for each in found}
