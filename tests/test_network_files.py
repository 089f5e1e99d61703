"""Policies from files of networks: ONNX, and zips of Stable-Baselines3."""

import json
import sys
import types
import zipfile

import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.policies.files import trained
from fetch_composer.tasks import TaskOptions
from tests import networks

_SIZES = {'observation': 25, 'achieved_goal': 3, 'desired_goal': 3}


@pytest.fixture(scope='module')
def env():
    env = fetch_composer.load('push', seed=0)
    yield env
    env.close()


@pytest.fixture
def observation(env):
    return env.reset().observation


# -- ONNX ------------------------------------------------------------------------------------------


@pytest.mark.parametrize('double', [False, True])
@pytest.mark.parametrize('batch', [[], [1], ['batch']])
@pytest.mark.parametrize(
    ('inputs', 'parts'),
    [
        ({'observation': 25, 'desired_goal': 3}, ('observation', 'desired_goal')),
        ({'desired_goal': 3, 'achieved_goal': 3}, ('desired_goal', 'achieved_goal')),
        ({'x': 25}, ('observation',)),
        ({'x': 28}, ('observation', 'desired_goal')),
        ({'x': 31}, ('achieved_goal', 'desired_goal', 'observation')),
        ({'observation': 31}, ('achieved_goal', 'desired_goal', 'observation')),
    ],
)
def test_a_network_acts_on_the_observations_that_it_names(
    tmp_path, env, observation, inputs, parts, batch, double
):
    path = str(tmp_path / 'policy.onnx')
    shapes = [(name, [*batch, size]) for name, size in inputs.items()]
    weights = networks.save(path, shapes, [('action', [*batch, 4])], double)
    policy = policies.load(path, env)
    policies.check_action(policy, observation, policies.PolicyContext.of(env))
    action = policy(observation)
    assert action.shape == (4,) and action.dtype == np.float32
    expected = np.concatenate([observation[part] for part in parts]) @ weights
    np.testing.assert_allclose(action, expected, atol=1e-4)


def test_a_network_is_run_by_the_batch(tmp_path):
    path = str(tmp_path / 'policy.onnx')
    networks.save(path, [('observation', ['batch', 25])])
    options = batch_rollout.EpisodeOptions('push', path, TaskOptions(max_episode_steps=4))
    (alone,) = batch_rollout.run_episodes(options, [1])
    together = batch_rollout.run_episodes(options, [0, 1, 2], num_envs=3)
    np.testing.assert_array_equal(alone.action, together[1].action)
    assert np.abs(alone.action).max() > 0


@pytest.mark.parametrize(
    ('inputs', 'outputs', 'message'),
    [
        (
            [('observation', [1, 24])],
            None,
            r"'observation' has shape \(1, 24\); .*valid are by name observation \(25\), .*single "
            r'input 25 \(observation\), 28 \(observation, desired_goal\), 31 \(achieved_goal, ',
        ),
        ([('x', ['n', 30])], None, r"'x' has shape \(n, 30\)"),
        ([('x', [1, 25]), ('y', [1, 3])], None, r'has the inputs x, y; valid are by name obs'),
        ([('observation', [8, 25])], None, r"'observation' has shape \(8, 25\)"),
        ([('observation', [1, 25])], [('out', [1, 3])], r"'out' has shape \(1, 3\), but an action"),
        ([('observation', [1, 25])], [('a', [1, 4]), ('b', [1, 4])], r'outputs a, b; one must be'),
    ],
)
def test_a_network_that_does_not_fit_is_named(tmp_path, env, inputs, outputs, message):
    path = str(tmp_path / 'policy.onnx')
    if outputs and outputs[0][1][-1] == 3:
        pytest.importorskip('onnx')
        networks.save_of_width_3(path)
    else:
        networks.save(path, inputs, outputs or [('action', [inputs[0][1][0], 4])])
    with pytest.raises(ValueError, match=message):
        policies.load(path, env)


def test_a_network_for_another_task_is_named(tmp_path):
    path = str(tmp_path / 'policy.onnx')
    networks.save(path, [('observation', ['batch', 25])])
    reach = fetch_composer.load('reach')
    with pytest.raises(ValueError, match=r'valid are by name observation \(10\), .*, 13 \('):
        policies.load(path, reach)


def test_what_is_no_network_is_named(tmp_path, env):
    pytest.importorskip('onnxruntime')
    path = tmp_path / 'policy.onnx'
    with pytest.raises(ValueError, match='There is no file'):
        policies.load(str(path), env)
    path.write_text('nonsense')
    with pytest.raises(ValueError, match=r'policy\.onnx cannot be read as ONNX'):
        policies.load(str(path), env)


def test_a_missing_onnxruntime_is_named_with_the_way_to_install_it(monkeypatch, env):
    monkeypatch.setitem(sys.modules, 'onnxruntime', None)
    with pytest.raises(ValueError, match=r"pip install 'fetch_composer\[onnx\]'"):
        policies.load('policy.onnx', env)


# -- Those that come with the package --------------------------------------------------------------


def test_a_trained_policy_is_found_by_task_and_convention(tmp_path, env, monkeypatch):
    monkeypatch.setattr(trained, '_FOLDER', tmp_path)
    with pytest.raises(ValueError, match='for push_documented; there is none for any task'):
        policies.load('trained', env)
    networks.save_perceptron(str(tmp_path / 'push_gymnasium_robotics.onnx'), 28)
    with pytest.raises(ValueError, match='push_documented; there is push_gymnasium_robotics'):
        policies.load('trained', env)
    networks.save_perceptron(str(tmp_path / 'push_documented.onnx'), 28)
    assert policies.load('trained', env)(env.reset().observation).shape == (4,)
    assert policies.digest('trained') is None


# -- Batches ---------------------------------------------------------------------------------------


@pytest.mark.parametrize('width', [25, 28, 31])
def test_an_episode_does_not_depend_on_what_runs_beside_it(tmp_path, width):
    path = str(tmp_path / 'policy.onnx')
    networks.save_perceptron(path, width)
    options = batch_rollout.EpisodeOptions('push', path, TaskOptions(max_episode_steps=3))
    together = batch_rollout.run_episodes(options, range(70), num_envs=64)
    for seeds, num_envs in ((range(70), 7), ((0, 3, 15, 16, 63, 64, 69), 1)):
        for episode in batch_rollout.run_episodes(options, seeds, num_envs=num_envs):
            np.testing.assert_array_equal(episode.action, together[episode.seed].action)
            np.testing.assert_array_equal(episode.observation, together[episode.seed].observation)


def _observations(count):
    generator = np.random.default_rng(1)
    return {name: generator.normal(size=(count, size)) for name, size in _SIZES.items()}


@pytest.mark.parametrize(('rows', 'mixing'), [('n', False), (1, False), ('n', True)])
def test_a_batch_is_given_the_actions_of_its_rows(tmp_path, env, rows, mixing):
    path = str(tmp_path / 'policy.onnx')
    networks.save_perceptron(path, 28, rows=rows, mixing=mixing)
    policy = policies.load(path, env)
    observations = _observations(37)
    actions = policy.act_on_batch(observations)
    assert actions.shape == (37, 4) and actions.dtype == np.float32
    for row in range(37):
        alone = policy({name: each[row] for name, each in observations.items()})
        np.testing.assert_array_equal(actions[row], alone)
    assert mixing == (not actions.any())  # A row less the mean of its own is 0.


def test_a_network_is_asked_once_for_many_rows(tmp_path, env, monkeypatch):
    onnxruntime = pytest.importorskip('onnxruntime')
    path = str(tmp_path / 'policy.onnx')
    networks.save_perceptron(path, 28)
    policy, calls = policies.load(path, env), []
    run = onnxruntime.InferenceSession.run

    def counted(session, names, feed):
        calls.append(len(feed['input']))
        return run(session, names, feed)

    monkeypatch.setattr(onnxruntime.InferenceSession, 'run', counted)
    policy.act_on_batch(_observations(37))
    policy.act_on_batch(_observations(1))
    assert calls == [16, 16, 16, 16]


# -- Stable-Baselines3, of which a stand-in is used: the real one brings gigabytes -----------------


def _save_zip(path, module='stable_baselines3.sac.policies', **data):
    with zipfile.ZipFile(path, 'w') as file:
        file.writestr('data', json.dumps({'policy_class': {'__module__': module}, **data}))


def _stand_in(monkeypatch, sizes=_SIZES, action=4):
    """Puts a package in the place of Stable-Baselines3 and returns what it was asked to load."""
    loaded = []

    class Model:
        observation_space = types.SimpleNamespace(
            spaces={k: types.SimpleNamespace(shape=(n,)) for k, n in sizes.items()}
        )
        action_space = types.SimpleNamespace(shape=(action,))

        @classmethod
        def load(cls, path, device, custom_objects):
            loaded.append((cls.__name__, path, device, custom_objects['buffer_size']))
            return cls()

        def predict(self, observation, deterministic):
            assert deterministic
            return observation['desired_goal'][:, [0, 1, 2, 0]], None

    package = types.ModuleType('stable_baselines3')
    for name in ('SAC', 'TD3', 'PPO', 'A2C'):
        setattr(package, name, type(name, (Model,), {}))
    monkeypatch.setitem(sys.modules, 'stable_baselines3', package)
    threads = {'get_num_threads': lambda: 1, 'set_num_threads': lambda count: None}
    monkeypatch.setitem(sys.modules, 'torch', types.SimpleNamespace(**threads))
    return loaded


def test_a_zip_is_not_read_unless_its_pickles_are_trusted(tmp_path, monkeypatch, env):
    loaded, path = _stand_in(monkeypatch), str(tmp_path / 'model.zip')
    _save_zip(path)
    with pytest.raises(ValueError, match='can run code as it is read.*--trust_pickle'):
        policies.load(path, env)
    options = batch_rollout.EpisodeOptions('push', path)
    with pytest.raises(ValueError, match='--trust_pickle'):
        batch_rollout.run_episodes(options, [0])
    assert not loaded


@pytest.mark.parametrize(
    ('module', 'data', 'algorithm'),
    [
        ('stable_baselines3.sac.policies', {}, 'SAC'),
        ('stable_baselines3.td3.policies', {}, 'TD3'),
        ('stable_baselines3.common.policies', {'clip_range': 0.2}, 'PPO'),
        ('stable_baselines3.common.policies', {}, 'A2C'),
    ],
)
def test_a_trusted_zip_is_loaded_by_its_algorithm(
    tmp_path, monkeypatch, env, observation, module, data, algorithm
):
    loaded, path = _stand_in(monkeypatch), str(tmp_path / 'model.zip')
    _save_zip(path, module, **data)
    policy = policies.load(path, env, trust_pickle=True)
    assert loaded == [(algorithm, path, 'cpu', 1)]
    policies.check_action(policy, observation, policies.PolicyContext.of(env))
    np.testing.assert_allclose(policy(observation)[:3], observation['desired_goal'], atol=1e-6)


def test_a_zip_that_does_not_fit_is_named(tmp_path, monkeypatch, env):
    path = str(tmp_path / 'model.zip')
    with pytest.raises(ValueError, match='There is no file'):
        policies.load(path, env)
    with zipfile.ZipFile(path, 'w') as file:
        file.writestr('other', '')
    with pytest.raises(ValueError, match='is no model of Stable-Baselines3'):
        policies.load(path, env)
    _save_zip(path, 'stable_baselines3.dqn.policies')
    with pytest.raises(ValueError, match='has a policy of stable_baselines3.dqn'):
        policies.load(path, env)
    _save_zip(path)
    _stand_in(monkeypatch, {**_SIZES, 'observation': 10})
    with pytest.raises(
        ValueError, match=r"observations .*\(10,\).*dictionary of .*'observation': 25"
    ):
        policies.load(path, env, trust_pickle=True)
    _stand_in(monkeypatch, action=3)
    with pytest.raises(ValueError, match=r'actions of shape \(3,\), but this task takes \(4,\)'):
        policies.load(path, env, trust_pickle=True)
    monkeypatch.setitem(sys.modules, 'stable_baselines3', None)
    with pytest.raises(ValueError, match=r"pip install 'fetch_composer\[sb3\]'"):
        policies.load(path, env, trust_pickle=True)


def _encrypted(content):
    for signature, offset in ((b'PK\3\4', 6), (b'PK\1\2', 8)):
        content[content.index(signature) + offset] |= 1


def _damaged(content):
    content[content.index(b'data') + 10] ^= 0xFF


def _of_another_compression(content):
    for signature, offset in ((b'PK\3\4', 8), (b'PK\1\2', 10)):
        content[content.index(signature) + offset] = 97


@pytest.mark.parametrize('change', [_encrypted, _damaged, _of_another_compression])
def test_a_zip_that_cannot_be_read_is_named(tmp_path, env, change):
    path = tmp_path / 'model.zip'
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as file:
        file.writestr('data', json.dumps({'policy_class': {'__module__': 'a'}, 'more': 99 * 'b'}))
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r'model\.zip is no model of Stable-Baselines3'):
        policies.load(str(path), env)


@pytest.mark.parametrize('member', ['data', 'policy.pth'])
def test_a_zip_is_measured_before_it_is_inflated(tmp_path, env, monkeypatch, member):
    path = tmp_path / 'model.zip'
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as file:
        file.writestr(member, b'{}')
        if member != 'data':
            file.writestr('data', b'{}')
    content = bytearray(path.read_bytes())
    # What the directory says that it holds: 4 GiB less 2 bytes.
    start = content.index(b'PK\1\2')
    content[start + 24 : start + 28] = (2**32 - 2).to_bytes(4, 'little')
    path.write_bytes(content)
    monkeypatch.setattr(zipfile.ZipFile, 'read', lambda *_: pytest.fail('It was inflated.'))
    with pytest.raises(ValueError, match=r'model\.zip would inflate to 4,096 MiB'):
        policies.load(str(path), env, trust_pickle=True)


def test_a_real_model_is_loaded(tmp_path, env, observation):
    sb3 = pytest.importorskip('stable_baselines3', reason='Stable-Baselines3 is not installed')
    import gymnasium

    model = sb3.SAC(
        'MultiInputPolicy', gymnasium.make('fetch_composer/FetchPush-v2'),
        replay_buffer_class=sb3.HerReplayBuffer, buffer_size=1000,
    )  # fmt: skip
    path = str(tmp_path / 'model.zip')
    model.save(path)
    policy = policies.load(path, env, trust_pickle=True)
    expected, _ = model.predict(dict(observation), deterministic=True)
    np.testing.assert_allclose(policy(observation), expected, atol=1e-6)
