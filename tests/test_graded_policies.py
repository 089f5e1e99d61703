"""Policies of graded skill: noise on actions, and mixtures by episode, both decided by the seed."""

import dataclasses
import re
import shlex

import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer import flags
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.results import summary
from fetch_composer.tasks import TaskOptions
from tests import episodes as acting
from tests import runs
from tests.test_resume import _arrays, _assert_same_results, _run, _run_stopped
from tests.test_resume import _options as _run_options

_MIXTURE = 'expert:0.6,random:0.4'
_STEPS = 6


def _options(policy, task='push', **task_options):
    return batch_rollout.EpisodeOptions(task, policy, TaskOptions('sparse', _STEPS, **task_options))


def _actions(options, seeds, num_envs):
    return {each.seed: each.action for each in batch_rollout.run_episodes(options, seeds, num_envs)}


@pytest.mark.parametrize('policy', ['expert~0.2', 'expert~0.2:0.6,random:0.4'])
def test_an_episode_is_its_seed_s_whatever_runs_beside_it(task_name, convention, policy):
    options = _options(policy, task_name, convention=convention)
    seeds = [3, 1, 8, 5]
    expected, others = (_actions(options, seeds, num_envs) for num_envs in (4, 3))
    for seed in seeds:
        np.testing.assert_array_equal(expected[seed], others[seed])
    env = acting.shared(task_name, **options.task_kwargs)
    single = acting.record(env, policy, seeds[0])
    np.testing.assert_allclose(single.action, expected[seeds[0]], rtol=0, atol=1e-6)


def test_noise_is_gaussian_independent_and_clipped():
    env = fetch_composer.load('push', seed=0)
    observation = env.reset().observation
    quiet, other = (policies.load('zero~0.2', env, seed) for seed in (0, 1))
    drawn = np.stack([quiet(observation) for _ in range(4000)])
    assert drawn.dtype == np.float32
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.015)
    np.testing.assert_allclose(np.cov(drawn.T), 0.04 * np.eye(4), atol=0.004)
    assert not np.array_equal(drawn[0], other(observation))
    loud = policies.load('zero~5', env, seed=0)
    drawn = np.stack([loud(observation) for _ in range(200)])
    assert set(np.sign(drawn[np.abs(drawn) == 1])) == {-1, 1} and np.abs(drawn).max() == 1
    env.close()


def test_noise_of_a_seed_tells_nothing_of_the_start_or_of_random_actions():
    env = fetch_composer.load('push', seed=7)
    observation = env.reset().observation
    uniform = policies.load('random', env, seed=7)(observation)
    noise = policies.load('zero~0.2', env, seed=7)(observation)
    ranks = np.random.Generator(np.random.PCG64(np.random.SeedSequence(7))).standard_normal(4)
    assert not np.allclose(noise, 0.2 * ranks) and not np.allclose(np.sign(noise), np.sign(uniform))
    env.close()


def test_any_policy_can_be_made_noisy_in_python():
    env = fetch_composer.load('reach', seed=0)
    observation = env.reset().observation
    named = policies.load('expert~0.3', env, seed=5)
    wrapped = policies.NoisyPolicy(policies.load('expert', env), env.action_spec(), 0.3, seed=5)
    for _ in range(3):
        np.testing.assert_array_equal(named(observation), wrapped(observation))
    env.close()


def test_a_mixture_is_played_by_its_shares_and_each_episode_by_one_policy():
    played = [policies.player(_MIXTURE, seed) for seed in range(2000)]
    assert set(played) == {'expert', 'random'}
    assert np.mean([each == 'expert' for each in played]) == pytest.approx(0.6, abs=0.04)
    of_mixture = _actions(_options(_MIXTURE), range(6), 6)
    of_each = {name: _actions(_options(name), range(6), 6) for name in ('expert', 'random')}
    for seed, actions in of_mixture.items():
        np.testing.assert_array_equal(actions, of_each[played[seed]][seed])
    assert len({*played[:6]}) == 2


def test_the_summary_says_which_policy_played_an_episode():
    found = batch_rollout.run_episodes(_options(_MIXTURE), range(6))
    figures = summary.summarize(found, _MIXTURE)['episodes']
    assert [each['policy'] for each in figures] == [
        policies.player(_MIXTURE, each['seed']) for each in figures
    ]
    assert 'policy' not in summary.summarize(found, 'expert~0.2')['episodes'][0]


@pytest.mark.parametrize(
    ('values', 'expected'),
    [
        ({'policy': ['zero', 'expert'], 'noise': 0.25}, ('zero~0.25', 'expert~0.25')),
        ({'mixture': _MIXTURE}, (_MIXTURE,)),
        ({'mixture': _MIXTURE, 'noise': 0.1}, ('expert~0.1:0.6,random~0.1:0.4',)),
        ({'policy': ['expert', 'expert~0.1', _MIXTURE]}, ('expert', 'expert~0.1', _MIXTURE)),
    ],
)
def test_flags_make_the_names_of_policies_that_a_replay_repeats(values, expected):
    options = runs.options(**{'policy': ['expert'], **values})
    assert options.policies == expected
    command = flags.replay_command(options, options.policies, 3)
    words = shlex.split(command)[3:]
    parser = flags.parser()
    parser(['explore.py', *words])
    again = flags.make_options(flags.option_values(parser))
    assert again.policies == expected and list(again.seeds) == [3]


def test_a_stopped_run_goes_on_with_the_same_noise_and_mixture(tmp_path):
    graded = {'policy': ['expert'], 'mixture': _MIXTURE, 'noise': 0.2}
    options = _run_options(tmp_path / 'stopped', **graded)
    _run_stopped(options, after=4)
    with pytest.raises(ValueError, match='unfinished run that differs in policies'):
        _run(_run_options(tmp_path / 'stopped', **{**graded, 'noise': 0.3}))
    assert _run(dataclasses.replace(options, num_envs=7)).continued == 4
    _run(_run_options(tmp_path / 'whole', num_envs=7, **graded))
    _assert_same_results(options.folder, tmp_path / 'whole')
    assert np.ptp(_arrays(options.folder)['action']) > 0


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('expert~-1', 'noise must be a finite number from 0; got -1.0'),
        ('expert~nan', 'noise must be a finite number from 0; got nan'),
        ('expert~0.1~0.2', 'noise is on a single policy, and once'),
        ('expert:0.5,zero:0.5~0.2', 'noise is on a single policy, and once'),
        ('exprt~0.1', "Unknown policy 'exprt'; valid are"),
        ('expert:0.5,exprt:0.5', "Unknown policy 'exprt'; valid are"),
        ('expert:0.5,zero', "Unknown policy 'expert:0.5,zero'; valid are.*for a mixture"),
        ('expert:0.5,zero:0.6', 'shares of a mixture are positive and add up to 1'),
        ('expert:0,zero:1', 'shares of a mixture are positive and add up to 1'),
        ('expert:1.5.2', 'shares of a mixture are positive and add up to 1'),
        ('expert:0.5,expert:0.5', 'names each of its policies once'),
    ],
)
def test_what_cannot_be_a_graded_policy_is_refused(name, message):
    env = fetch_composer.load('reach')
    with pytest.raises(ValueError, match=message):
        policies.load(name, env)
    env.close()


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'noise': float('inf')}, 'noise must be a finite number from 0; got inf'),
        ({'noise': -0.1}, 'noise must be a finite number from 0; got -0.1'),
        ({'mixture': 'expert'}, 'mixture must name policies and their shares, such as'),
        ({'mixture': _MIXTURE, 'policy': ['zero']}, 'mixture takes the place of policy'),
        ({'policy': ['expert~0.1', 'expert'], 'noise': 0.1}, 'noise is on a single policy'),
    ],
)
def test_what_cannot_be_noise_or_mixture_is_refused_before_a_folder_is_made(
    tmp_path, values, message
):
    with pytest.raises(ValueError, match=re.escape(message)):
        _run(_run_options(tmp_path / 'run', **{'policy': ['expert'], **values}))
    assert not (tmp_path / 'run').exists()


def test_every_policy_of_a_mixture_is_tried_before_the_first_step(tmp_path, monkeypatch):
    (tmp_path / 'misfit.py').write_text('def act(observation):\n    return [0.0]\n')
    monkeypatch.chdir(tmp_path)
    name = 'zero:0.999,misfit:act:0.001'
    assert policies.player(name, 0) == 'zero'
    with pytest.raises(batch_rollout.PolicyError, match='misfit:act, before the first step'):
        batch_rollout.run_episodes(_options(name), [0])


def test_an_action_of_another_shape_is_not_repeated_to_fit():
    env = fetch_composer.load('reach', seed=0)
    policy = policies.NoisyPolicy(
        policies.given.factory(lambda observation: [0.5], policies.PolicyContext.of(env))(0),
        env.action_spec(),
        0.1,
    )
    with pytest.raises(policies.ActionError, match='shape'):
        policy(env.reset().observation)
    env.close()
