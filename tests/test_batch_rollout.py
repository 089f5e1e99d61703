"""Episodes run on the batch: the same as single ones, and the same whatever runs beside them."""

import dataclasses
import pickle
import subprocess
import sys

import numpy as np
import pytest

import fetch_composer
from fetch_composer.explorer.episodes import batch_rollout, replay
from fetch_composer.tasks import TaskOptions
from tests import episodes as acting

_ARRAYS = ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward')
_STEPS = 25


def _options(task='push', policy='random', **task_options):
    task_options = TaskOptions(**{'max_episode_steps': _STEPS, **task_options})
    return batch_rollout.EpisodeOptions(task, policy, task_options)


def _assert_equal(episodes, others):
    assert [each.seed for each in episodes] == [each.seed for each in others]
    for episode, other in zip(episodes, others, strict=True):
        for name in _ARRAYS:
            one, two = getattr(episode, name), getattr(other, name)
            assert one.shape == two.shape and one.dtype == two.dtype
            np.testing.assert_array_equal(one, two, err_msg=name)


@pytest.mark.parametrize('policy', ['expert', 'random'])
def test_an_episode_is_that_of_the_single_environment(task_name, convention, policy):
    options = _options(task=task_name, policy=policy, convention=convention, reward_type='dense')
    env = acting.shared(task_name, **options.task_kwargs)
    seeds = [4, 2, 9]
    expected = [acting.record(env, policy, seed) for seed in seeds]
    for num_envs in (1, 2):
        _assert_equal(batch_rollout.run_episodes(options, seeds, num_envs=num_envs), expected)


def test_an_episode_depends_on_its_seed_alone():
    options, seeds = _options(), list(range(5))
    together = batch_rollout.run_episodes(options, seeds, num_envs=5)
    _assert_equal(batch_rollout.run_episodes(options, seeds, num_envs=2), together)
    _assert_equal(batch_rollout.run_episodes(options, seeds, num_envs=100), together)
    _assert_equal(batch_rollout.run_episodes(options, seeds, num_envs=1), together)
    _assert_equal(batch_rollout.run_episodes(options, seeds[::-1], 3), together[::-1])
    with batch_rollout.BatchRollout(options, 2) as batch:
        for seed in (3, 1):  # The same batch, used again.
            (chunk,) = batch.run([seed])
            _assert_equal(chunk, [together[seed]])
    assert batch_rollout.run_episodes(options, []) == []


def test_work_and_result_can_be_sent_to_another_process(tmp_path):
    options = _options(policy='expert')
    (tmp_path / 'work').write_bytes(pickle.dumps((options, [7, 8])))
    code = (
        'import pathlib, pickle, sys\n'
        'from fetch_composer.explorer.episodes import batch_rollout\n'
        'work = pickle.loads(pathlib.Path("work").read_bytes())\n'
        'result = batch_rollout.run_episodes(*work)\n'
        'pathlib.Path("result").write_bytes(pickle.dumps(result))\n'
        'needless = {"imageio", "matplotlib", "tqdm", "PIL", "jinja2"} & set(sys.modules)\n'
        'assert not needless, needless'
    )
    subprocess.run([sys.executable, '-c', code], cwd=tmp_path, check=True)
    result = pickle.loads((tmp_path / 'result').read_bytes())
    _assert_equal(result, batch_rollout.run_episodes(options, [7, 8]))


def test_whoever_watches_can_end_a_run():
    class Enough(Exception):
        pass

    taken = []

    def on_progress(episodes):
        taken.append(episodes)
        if len(taken) > _STEPS:
            raise Enough

    finished = []
    with batch_rollout.BatchRollout(_options(), 2) as batch, pytest.raises(Enough):
        finished.extend(batch.run([0, 1, 2], on_progress))
    assert [[each.seed for each in chunk] for chunk in finished] == [[0, 1]]
    assert taken == [2] * _STEPS + [1]


def test_mistakes_are_named_before_the_first_step():
    for changes, message in (
        ({'task': 'pusch'}, "Unknown task 'pusch'"),
        ({'policy': 'exprt'}, "Unknown policy 'exprt'; valid are expert, random, zero"),
        ({'max_episode_steps': None}, 'episodes must end'),
    ):
        with pytest.raises(ValueError, match=message):
            batch_rollout.run_episodes(_options(**changes), [0])
    with pytest.raises(ValueError, match='num_envs must be a positive integer'):
        batch_rollout.run_episodes(_options(), [0], num_envs=0)


# -- Replay ----------------------------------------------------------------------------------------


def test_a_replay_ends_where_the_episode_of_the_batch_did(task_name, convention):
    options = _options(task=task_name, policy='expert', convention=convention, max_episode_steps=50)
    episodes = batch_rollout.run_episodes(options, [11, 12, 13])
    env = acting.shared(task_name, **options.task_kwargs)
    shown = []
    for episode in episodes:
        replay.replay(env, episode, shown.append)
    assert shown == list(range(51)) * 3


def test_a_replay_that_ends_elsewhere_is_an_error():
    options = _options()
    (episode,) = batch_rollout.run_episodes(options, [3])
    env = fetch_composer.load('push', **options.task_kwargs)
    other = dataclasses.replace(episode, seed=4)
    with pytest.raises(replay.ReplayError, match='seed 4 was played again and ended elsewhere'):
        replay.replay(env, other)
