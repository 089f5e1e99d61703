"""Models of Stable-Baselines3 in the explorer, as it is started by users: in a process with OpenGL.

With OpenGL in software, torch's compiler would end a process that has loaded it.
"""

import dataclasses
import functools
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

sb3 = pytest.importorskip('stable_baselines3', reason='Stable-Baselines3 is not installed')
pytest.importorskip('imageio', reason="the explorer's packages are not installed")

import gymnasium as gym  # noqa: E402
from gymnasium import wrappers  # noqa: E402
from stable_baselines3.common import vec_env  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import explorer, policies  # noqa: E402
from fetch_composer.explorer.episodes import batch_rollout  # noqa: E402
from fetch_composer.tasks import TaskOptions  # noqa: E402

pytestmark = [
    pytest.mark.clients,
    pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning'),
]

_ROOT = pathlib.Path(__file__).parents[2]
_SCRIPT = (str(_ROOT / 'explore.py'),)
_MODULE = ('-m', 'fetch_composer.explorer')
_TORCH_POLICY = """
import numpy as np
import fetch_composer

def act(observation):
    import torch
    torch.optim.Adam(torch.nn.Linear(3, 4).parameters())
    return np.zeros(4)
"""


def _save(path, algorithm='SAC', wrap=None, task='Push'):
    """Saves a model that has learned nothing."""
    env = gym.make(f'fetch_composer/Fetch{task}-v2')
    env = wrap(env) if wrap else env
    is_dictionary = isinstance(env.observation_space, gym.spaces.Dict)
    kwargs = {} if algorithm in ('PPO', 'A2C') else {'buffer_size': 1000}
    package = pytest.importorskip('sb3_contrib') if algorithm == 'TQC' else sb3
    model = getattr(package, algorithm)(
        'MultiInputPolicy' if is_dictionary else 'MlpPolicy', env, seed=0, **kwargs
    )
    model.save(path)
    env.close()
    return model


def _explore(folder, *flags, program=_SCRIPT):
    result = subprocess.run(
        [
            sys.executable, *program, '--episodes=2', '--max_episode_steps=5', '--num_films=1',
            '--width=96', '--height=64', f'--output_dir={folder / "out"}', *flags,
        ],
        env={**os.environ, 'PYTHONPATH': str(_ROOT), 'MUJOCO_GL': 'egl'},
        cwd=folder,
        capture_output=True,
        text=True,
    )  # fmt: skip
    assert result.returncode == 0, (result.returncode, result.stderr)
    return json.loads((folder / 'out' / 'summary.json').read_text())


@pytest.mark.parametrize(
    ('algorithm', 'program', 'films'),
    [
        ('SAC', _SCRIPT, 'none'),
        ('SAC', _SCRIPT, 'first'),
        ('SAC', _MODULE, 'first'),
        ('TD3', _SCRIPT, 'first'),
        ('PPO', _SCRIPT, 'first'),
        ('TQC', _SCRIPT, 'first'),
    ],
)
def test_a_model_is_run_and_filmed(tmp_path, algorithm, program, films):
    path = tmp_path / 'model.zip'
    _save(path, algorithm)
    summary = _explore(
        tmp_path, f'--policy={path}', '--trust_pickle', f'--films={films}', program=program
    )
    assert summary['episodes_finished'] == 2
    if summary['gl_backend'] is not None:
        assert ('episode_000.mp4' in summary['files']) == (films == 'first')


def test_code_that_imports_torch_late_is_run_and_filmed(tmp_path):
    (tmp_path / 'torch_policy.py').write_text(_TORCH_POLICY)
    summary = _explore(tmp_path, '--policy=torch_policy:act', '--films=first')
    assert summary['episodes_finished'] == 2


@pytest.mark.parametrize('task', ['Push', 'Reach'])
@pytest.mark.parametrize(
    'wrap',
    [
        None,
        wrappers.FlattenObservation,
        lambda env: wrappers.FilterObservation(env, ['observation', 'desired_goal']),
        lambda env: wrappers.FlattenObservation(wrappers.FilterObservation(env, ['observation'])),
    ],
    ids=['dictionary', 'flattened', 'two', 'observation'],
)
def test_a_model_gets_what_it_was_trained_on(tmp_path, wrap, task):
    path = str(tmp_path / 'model.zip')
    model = _save(path, 'SAC', wrap, task)
    env = gym.make(f'fetch_composer/Fetch{task}-v2')
    env = wrap(env) if wrap else env
    given, _ = env.reset(seed=3)
    expected, _ = model.predict(given, deterministic=True)
    single = fetch_composer.load(task.lower(), seed=0)
    policy = policies.load(path, single, trust_pickle=True)
    observation = env.unwrapped.reset(seed=3)[0]
    np.testing.assert_allclose(policy(observation), expected, atol=1e-5)
    env.close()
    single.close()


def test_an_episode_does_not_depend_on_what_runs_beside_it(tmp_path):
    path = str(tmp_path / 'model.zip')
    _save(path)
    options = batch_rollout.EpisodeOptions(
        'push', path, TaskOptions(max_episode_steps=3), trust_pickle=True
    )
    together = batch_rollout.run_episodes(options, range(70), num_envs=64)
    for seeds, num_envs in ((range(70), 7), ((0, 5, 63, 64, 69), 1)):
        for episode in batch_rollout.run_episodes(options, seeds, num_envs=num_envs):
            np.testing.assert_array_equal(episode.action, together[episode.seed].action)


def test_a_model_acts_on_a_batch_at_once(tmp_path):
    path = str(tmp_path / 'model.zip')
    model = _save(path)
    single = fetch_composer.load('push', seed=0)
    policy = policies.load(path, single, trust_pickle=True)
    sizes = {name: spec.shape[0] for name, spec in single.observation_spec().items()}
    generator = np.random.default_rng(0)
    observations = {name: generator.normal(size=(70, size)) for name, size in sizes.items()}
    actions = policy.act_on_batch(observations)
    expected, _ = model.predict(observations, deterministic=True)
    np.testing.assert_allclose(actions, expected, atol=1e-5)
    for row in range(70):
        alone = policy({name: each[row] for name, each in observations.items()})
        np.testing.assert_array_equal(actions[row], alone)
    single.close()


@pytest.mark.parametrize(
    'wrap', [None, wrappers.FlattenObservation], ids=['dictionary', 'flattened']
)
def test_a_model_is_evaluated_while_it_is_trained_as_its_file_is_afterwards(tmp_path, wrap):
    path = str(tmp_path / 'model.zip')
    model = _save(path, 'SAC', wrap, 'Reach')
    given = {'seeds': range(500_000, 500_070), 'max_episode_steps': 5}
    during = explorer.evaluate(model, 'reach', **given)
    after = explorer.evaluate(path, 'reach', trust_pickle=True, **given)
    assert during.policy == 'SAC'
    assert dataclasses.replace(during, policy=path) == after
    other = explorer.evaluate('zero', 'reach', **given)
    assert other.final_distance != during.final_distance


def _normalized(task):
    """Returns a model, and the `VecNormalize` that is around its environment."""
    make = functools.partial(gym.make, f'fetch_composer/Fetch{task}-v2')
    vector = vec_env.VecNormalize(vec_env.DummyVecEnv([make]))
    vector.reset()
    for _ in range(10):  # So that the statistics are some.
        vector.step(np.ones((1, 4), np.float32))
    return sb3.PPO('MultiInputPolicy', vector, n_steps=8, seed=0), vector


def test_a_model_under_vec_normalize_is_given_what_it_learns_from():
    model, vector = _normalized('Push')
    single = fetch_composer.load('push', seed=3)
    observation = single.reset().observation
    seen = []
    predict = model.predict
    model.predict = lambda given, **kwargs: seen.append(given) or predict(given, **kwargs)
    policies.given.factory(model, policies.PolicyContext.of(single))(0)(observation)
    expected = vector.normalize_obs({name: each[None] for name, each in observation.items()})
    for name, each in expected.items():
        np.testing.assert_allclose(seen[-1][name][:1], each)
        assert not np.allclose(each, observation[name])
    single.close()
    vector.close()


def test_a_file_is_given_what_vec_normalize_saved_beside_it(tmp_path):
    model, vector = _normalized('Reach')
    path = str(tmp_path / 'model.zip')
    model.save(path)
    given = {'seeds': range(500_000, 500_010), 'max_episode_steps': 5}
    during = explorer.evaluate(model, 'reach', **given)
    without = explorer.evaluate(path, 'reach', trust_pickle=True, **given)
    vector.save(str(tmp_path / 'model_vecnormalize.pkl'))
    after = explorer.evaluate(path, 'reach', trust_pickle=True, **given)
    assert dataclasses.replace(during, policy=path) == after
    assert without.final_distance != after.final_distance

    (tmp_path / 'model_vecnormalize.pkl').write_bytes(b'nothing')
    with pytest.raises(ValueError, match='model_vecnormalize.pkl cannot be loaded as VecNormalize'):
        explorer.evaluate(path, 'reach', trust_pickle=True, **given)
    vector.close()
