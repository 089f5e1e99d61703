"""Evaluations: in Python, and the standard one of the command line."""

import dataclasses
import pathlib
import re

import numpy as np
import pytest

import fetch_composer
from fetch_composer import explorer, policies
from fetch_composer.explorer import __main__ as main_lib
from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import batch_rollout, seeds
from fetch_composer.explorer.results import evaluation, standard
from fetch_composer.tasks import TaskOptions
from tests import runs

_SEEDS = range(500_000, 500_006)
_STEPS = 12


def _towards(observation):
    way = observation['desired_goal'] - observation['achieved_goal']
    return np.pad(np.clip(10 * way, -1, 1), [(0, 0)] * (way.ndim - 1) + [(0, 1)])


class _OnBatch:
    def act_on_batch(self, observations):
        return _towards(observations)


class _Either(_OnBatch):
    """As a class it is made for each episode, and so acts in one."""

    def __call__(self, observation):
        return _towards(observation)


class _Model:
    """Acts as a model of Stable-Baselines3 does."""

    def __init__(self, env):
        self.observation_space = np.empty(env.observation_spec()['observation'].shape[0] + 6)
        self.action_space = np.empty(4)

    def predict(self, observation, deterministic):
        assert deterministic
        # Gymnasium's FlattenObservation: achieved goal, desired goal, observation.
        return np.pad(np.clip(10 * (observation[:, 3:6] - observation[:, :3]), -1, 1),
                      ((0, 0), (0, 1))), None  # fmt: skip


class _Counter:
    """Keeps count of the steps in its episode, and so must be alone in it."""

    def __init__(self):
        self.steps, self.episodes = 0, []

    def reset(self):
        self.episodes.append(self.steps)
        self.steps = 0

    def __call__(self, observation):
        self.steps += 1
        return _towards(observation)


def _evaluate(policy, task='reach', **kwargs):
    return explorer.evaluate(policy, task, seeds=_SEEDS, max_episode_steps=_STEPS, **kwargs)


def test_figures_are_those_of_the_episodes(task_name, convention):
    result = _evaluate('random', task_name, convention=convention, reward_type='dense')
    options = TaskOptions(reward_type='dense', max_episode_steps=_STEPS, convention=convention)
    episodes = batch_rollout.run_episodes(
        batch_rollout.EpisodeOptions(task_name, 'random', options), _SEEDS
    )
    assert (result.task, result.convention, result.policy) == (task_name, convention, 'random')
    assert result.episodes == len(_SEEDS)
    for estimate, values in (
        (result.success_rate, [each.is_success for each in episodes]),
        (result.mean_return, [each.total_reward for each in episodes]),
        (result.final_distance, [each.distance[-1] for each in episodes]),
    ):
        assert estimate.value == pytest.approx(np.mean(values), abs=1e-12)
        assert estimate.low <= estimate.value <= estimate.high


def test_a_policy_may_be_given_in_any_form():
    with fetch_composer.load('reach', seed=0) as env:
        model = _Model(env)
    expected = _evaluate(_towards)
    assert expected.success_rate.value == 1
    results = [_evaluate(_OnBatch()), _evaluate(model), _evaluate(_Counter), _evaluate(_Either)]
    results.append(_evaluate(_towards, vectorized=True))
    for result in results:
        assert result.final_distance.value == pytest.approx(expected.final_distance.value, abs=1e-6)
    assert [each.policy for each in results] == [
        '_OnBatch', '_Model', '_Counter', '_Either', '_towards',
    ]  # fmt: skip


def test_one_that_may_remember_its_episode_plays_one_after_the_other():
    counter = _Counter()
    _evaluate(counter)
    assert counter.episodes[-len(_SEEDS) :][1:] == [_STEPS] * (len(_SEEDS) - 1)
    with fetch_composer.load('push', seed=0) as env:
        expert = policies.load('expert', env)
    assert _evaluate(expert, 'push').final_distance == _evaluate('expert', 'push').final_distance


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'task': 'pusch'}, "Unknown task 'pusch'; valid are"),
        ({'convention': 'v1'}, "Unknown convention 'v1'; valid are"),
        ({'steps': 3}, "Unknown option 'steps'; of a task, valid are reward_type,"),
        ({'seeds': []}, 'seeds must name at least one'),
        ({'policy': 3}, "'int' cannot be called"),
        ({'vectorized': True}, 'vectorized is for a function'),
        ({'policy': 'exprt'}, "Unknown policy 'exprt'; valid are"),
        ({'max_episode_steps': None}, 'max_episode_steps must be a positive integer'),
    ],
)
def test_a_mistake_is_named(arguments, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        explorer.evaluate(**{'policy': 'zero', 'task': 'reach', **arguments})


def test_an_action_that_does_not_fit_is_named():
    with pytest.raises(batch_rollout.PolicyError, match=r'shape \(3,\); \(4,\) is needed'):
        explorer.evaluate(lambda observation: np.zeros(3), 'reach')


def test_unless_asked_no_held_out_seed_is_used():
    assert seeds.STANDARD == explorer.STANDARD_SEEDS == range(1_000_000, 1_001_000)
    assert not set(evaluation.DEFAULT_SEEDS) & set(explorer.STANDARD_SEEDS)
    ranges = (seeds.TRAINING, seeds.TUNING, seeds.STANDARD)
    assert all(a.stop <= b.start for a, b in zip(ranges[:-1], ranges[1:], strict=True))


def test_examples_and_documents_use_no_held_out_seed():
    root = pathlib.Path(__file__).parents[1]
    texts = {path: path.read_text(encoding='utf-8') for path in root.glob('examples/*.py')}
    for path in (root / 'README.md', *root.glob('docs/*.md')):
        texts[path] = ''.join(re.findall('```.*?```', path.read_text(encoding='utf-8'), re.DOTALL))
    for path, text in texts.items():
        assert not re.search(r'seed\S*[ =(]+1[_,]?000[_,]?\d{3}\b', text), path
        assert not re.search('HELD_OUT|seeds.STANDARD|STANDARD_SEEDS', text), path


def test_evaluating_imports_nothing_that_draws():
    runs.check_imports_none_of(
        'from fetch_composer import explorer',
        ('matplotlib', 'imageio', 'jinja2', 'PIL', 'tqdm', 'viser', 'scipy.stats'),
    )


# -- The standard evaluation -----------------------------------------------------------------------


@pytest.fixture
def few(monkeypatch):
    """A thousand episodes would take longer than all else."""
    monkeypatch.setitem(standard.FIXED, 'episodes', 3)
    usual = standard.fixed
    monkeypatch.setattr(
        standard, 'fixed', lambda task: {**usual(task), 'max_episode_steps': _STEPS}
    )


def _options(folder, **changes):
    given = {'standard': True, 'task': 'reach', 'policy': ['zero'], 'output_dir': str(folder)}
    return flags.make_options({**given, **changes})


def test_a_standard_evaluation_is_of_the_held_out_seeds_without_films(tmp_path):
    options = _options(tmp_path)
    options.check()
    assert options.seeds == explorer.STANDARD_SEEDS
    assert options.steps == 50
    assert options.films == 'none'
    assert _options(tmp_path, films='worst').films == 'worst'


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('seed', 0),
        ('episodes', 5),
        ('max_episode_steps', 51),
        ('reward_type', 'dense'),
        ('goal', [1.3, 0.75, 0.5]),
        ('object_position', [1.3, 0.75]),
    ],
)
def test_what_contradicts_the_standard_evaluation_is_refused(tmp_path, name, value):
    message = f'standard is of seeds 1000000 to 1000999, .*; got {name} .*Leave out {name}'
    with pytest.raises(ValueError, match=message):
        run_lib.Run(_options(tmp_path / 'out', **{name: value}), None)
    assert not runs.names(tmp_path)


def test_what_agrees_with_it_is_taken(tmp_path):
    _options(tmp_path, seed=1_000_000, episodes=1000, max_episode_steps=50).check()


def test_it_prints_a_table_and_nothing_else_to_standard_output(tmp_path, few, capsys):
    words = ['--standard', '--task=reach', '--policy=zero', '--policy=random']
    assert main_lib.main([*words, f'--output_dir={tmp_path}']) == 0
    captured = capsys.readouterr()
    header, rule, *rows = (
        [cell.strip() for cell in line.strip('|').split('|')] for line in captured.out.splitlines()
    )
    assert tuple(header) == standard.HEADER and set(rule) == {'-'}
    assert [row[:3] for row in rows] == [
        ['reach', 'documented', each] for each in ('zero', 'random')
    ]
    assert 'report.html' in captured.err
    given = range(1_000_000, 1_000_003)
    for row in rows:
        result = explorer.evaluate(row[2], 'reach', seeds=given, max_episode_steps=_STEPS)
        assert tuple(row) == standard.cells(result)
    assert runs.summary(tmp_path)['standard'] == rows
    assert max(map(len, captured.out.splitlines())) <= 80


def test_a_row_holds_together_whatever_a_policy_is_called():
    result = _evaluate('zero')
    row = dataclasses.replace(result, policy='a|b')
    assert standard.table([row])[2].count('|') - standard.table([row])[2].count(r'\|') == 7
