"""Policies from the user's own code."""

import sys

import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.tasks import TaskOptions


@pytest.fixture(scope='module')
def env():
    env = fetch_composer.load('push', seed=0)
    yield env
    env.close()


_CODE = """
import sys
import numpy as np

def still(observation):
    return [0, 0, 0, 0]

def towards(observation):
    return np.append(observation['desired_goal'] - observation['observation'][:3], 0)

class Noisy:
    resets = 0
    def __init__(self, seed):
        self.generator = np.random.default_rng(seed)
    def reset(self):
        Noisy.resets += 1
    def __call__(self, observation):
        return self.generator.uniform(-1, 1, 4)

def make(context, seed=None):
    assert context.task_name == 'push'
    return Noisy(seed)

def short(observation):
    return np.zeros(3)

def words(observation):
    return ['a', 'b', 'c', 'd']

def broken(observation):
    return 1 / 0

def late(observation):
    moved = observation['observation'][:3] - (1.3419, 0.7491, 0.535)
    return np.full(4, np.nan) if np.abs(moved).max() > 0.01 else np.ones(4)

def far(observation):
    return np.array([1.5, -1e300, 0.1, 1e39])

class Reusing:
    # Returns the same array every time.
    buffer = np.zeros(4)
    def __call__(self, observation):
        self.buffer[:3] = observation['desired_goal'] - observation['observation'][:3]
        return self.buffer

def masked(observation):
    return np.ma.array(np.ones(4), mask=[1, 0, 0, 0])

def ends(observation):
    sys.exit(0)

class EndsAtStart:
    def __init__(self, seed):
        if seed == 9:
            sys.exit(0)
    def __call__(self, observation):
        return np.zeros(4)

class ForgetsBadly:
    def __init__(self, seed):
        self.seed = seed
    def reset(self):
        assert self.seed != 9, 'no memory of it'
    def __call__(self, observation):
        return np.zeros(4)

def _is_later(observation):
    return np.abs(observation['observation'][:3] - (1.3419, 0.7491, 0.535)).max() > 0.01

def shrinks(observation):
    return np.ones(3 if _is_later(observation) else 4)

def falls_silent(observation):
    return None if _is_later(observation) else np.ones(4)

a_number = 3
"""


@pytest.fixture
def code(tmp_path, monkeypatch):
    """Makes a module in the working directory; returns its name."""
    name = f'own_{tmp_path.name}'
    (tmp_path / f'{name}.py').write_text(_CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'path', [each for each in sys.path if each])
    yield name
    sys.modules.pop(name, None)


def _run(policy, seeds=(0,), **options):
    task_options = TaskOptions(max_episode_steps=6)
    options = batch_rollout.EpisodeOptions('push', policy, task_options, **options)
    return batch_rollout.run_episodes(options, seeds, num_envs=2)


def test_a_run_loads_and_tries_each_policy_once(code, monkeypatch, tmp_path):
    loaded, load = [], policies.factory

    def factory(name, *args):
        loaded.append(name)
        return load(name, *args)

    monkeypatch.setattr(policies, 'factory', factory)
    names = [f'{code}:Noisy', f'{code}:still']
    run = run_lib.Run(
        flags.make_options({'policy': names, 'episodes': 3, 'max_episode_steps': 2}), None
    )
    run.run()
    run.close()
    assert loaded == names
    assert sys.modules[code].Noisy.resets == 3 + 1


def test_a_function_acts(code):
    (episode,) = _run(f'{code}:towards')
    expected = episode.desired_goal[0] - episode.observation[0, :3]
    np.testing.assert_allclose(episode.action[0, :3], expected)
    (episode,) = _run(f'{code}:still')
    np.testing.assert_array_equal(episode.action, 0)


def test_a_policy_may_return_the_same_array_every_time(code):
    reusing, plain = (_run(f'{code}:{name}', (4, 5, 6)) for name in ('Reusing', 'towards'))
    for one, other in zip(reusing, plain, strict=True):
        np.testing.assert_array_equal(one.action, other.action)
        np.testing.assert_array_equal(one.observation, other.observation)


@pytest.mark.parametrize('maker', ['Noisy', 'make'])
def test_a_maker_makes_a_policy_for_each_episode(code, maker):
    episodes = _run(f'{code}:{maker}', (5, 6, 7))
    expected = [np.random.default_rng(seed).uniform(-1, 1, (6, 4)) for seed in (5, 6, 7)]
    np.testing.assert_allclose([each.action for each in episodes], expected)
    assert sys.modules[code].Noisy.resets == 4  # And once for the trial before the first step.


@pytest.mark.parametrize(
    ('function', 'error', 'message'),
    [
        ('short', RuntimeError, r'before the first step: .*shape \(3,\); \(4,\) is needed'),
        ('words', RuntimeError, 'before the first step: .*floats are needed'),
        ('masked', RuntimeError, 'before the first step: .*masked values'),
        ('broken', RuntimeError, r'before the first step: ZeroDivisionError.*own_.*\.py, line 31'),
        ('late', RuntimeError, r'step [12]: .*The action is not finite for seed 9'),
        ('ends', RuntimeError, r'before the first step: SystemExit: 0 \(own_.*\.py, line'),
        ('EndsAtStart', RuntimeError, 'at the start of an episode: SystemExit: 0'),
        ('ForgetsBadly', RuntimeError, 'at the start of an episode: .*no memory of it'),
        ('shrinks', RuntimeError, r'step [12]: .*shape \((1, )?3,?\); \((1, )?4,?\) is needed'),
        ('falls_silent', RuntimeError, 'step [12]: .*an action of object; floats are needed'),
        ('missing', ValueError, "there is no 'missing' in .*it has .*still"),
        ('a_number', ValueError, 'cannot be called: it is a int'),
    ],
)
def test_a_function_that_fails_is_named_with_its_place(code, function, error, message):
    with pytest.raises(error, match=message):
        _run(f'{code}:{function}', (9,))


def test_an_unknown_module_and_an_unknown_policy_are_named(code, env):
    with pytest.raises(ValueError, match="There is no module 'nowhere.at_all'"):
        policies.load('nowhere.at_all:act', env)
    with pytest.raises(ValueError, match=r'valid are expert, .*PATH\.onnx.*module:function'):
        policies.load('nowhere.py', env)


def test_a_digest_tells_whether_a_policy_has_changed(code, tmp_path, env):
    assert policies.digest('expert') is None
    policies.load(f'{code}:still', env)
    before = policies.digest(f'{code}:still')
    (tmp_path / f'{code}.py').write_text(_CODE + '\n')
    assert before != policies.digest(f'{code}:still')
    (tmp_path / 'a.zip').write_text('a')
    assert policies.digest('a.zip') != before


def test_a_module_that_ends_python_is_named(code, tmp_path, env):
    (tmp_path / f'{code}_ends.py').write_text('import sys\nsys.exit(0)\n')
    with pytest.raises(ValueError, match=rf"The module '{code}_ends' calls sys\.exit\(0\)"):
        policies.load(f'{code}_ends:act', env)


@pytest.mark.parametrize('seeds', [np.arange(3), range(3), (0, 1, 2)])
def test_seeds_come_in_any_sequence(seeds):
    options = batch_rollout.EpisodeOptions('reach', 'zero', TaskOptions(max_episode_steps=2))
    assert [each.seed for each in batch_rollout.run_episodes(options, seeds)] == [0, 1, 2]


@pytest.mark.parametrize('seeds', [5, 'abc', None, 1.5])
def test_what_is_no_sequence_of_seeds_is_named(seeds):
    options = batch_rollout.EpisodeOptions('reach', 'zero', TaskOptions(max_episode_steps=2))
    with pytest.raises(ValueError, match='seeds must be a sequence; got'):
        batch_rollout.run_episodes(options, seeds)


def test_what_is_recorded_is_the_action_that_was_taken(code):
    """Clipped, and of the type that the spec of actions has."""
    options = TaskOptions(max_episode_steps=5)
    chosen = batch_rollout.EpisodeOptions('push', f'{code}:far', options)
    (episode,) = batch_rollout.run_episodes(chosen, [0])
    assert episode.action.dtype == np.float32
    np.testing.assert_array_equal(episode.action, np.tile(np.float32([1, -1, 0.1, 1]), (5, 1)))
