"""Policies from files and from the user's own code."""

import json
import sys
import types
import zipfile

import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.tasks import TaskOptions

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


def _save_onnx(path, inputs, outputs=(('action', ['batch', 4]),), double=False):
    """Writes a network whose action is a linear function of its inputs, in their order."""
    onnx = pytest.importorskip('onnx')
    pytest.importorskip('onnxruntime')
    helper = onnx.helper
    kind = onnx.TensorProto.DOUBLE if double else onnx.TensorProto.FLOAT
    width = sum(shape[-1] for _, shape in inputs)
    weights = np.linspace(-1, 1, 4 * width).reshape(width, 4)
    weights = weights.astype(np.float64 if double else np.float32)
    nodes = [
        helper.make_node('Concat', [name for name, _ in inputs], ['joined'], axis=-1),
        *(helper.make_node('MatMul', ['joined', 'weights'], [name]) for name, _ in outputs),
    ]
    graph = helper.make_graph(
        nodes,
        'policy',
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in inputs],
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in outputs],
        [onnx.numpy_helper.from_array(weights, 'weights')],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid('', 17)], ir_version=8)
    onnx.save(model, path)
    return weights


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
    weights = _save_onnx(path, shapes, [('action', [*batch, 4])], double)
    policy = policies.load(path, env)
    policies.check_action(policy, observation, policies.PolicyContext.of(env))
    action = policy(observation)
    assert action.shape == (4,) and action.dtype == np.float32
    expected = np.concatenate([observation[part] for part in parts]) @ weights
    np.testing.assert_allclose(action, expected, atol=1e-4)


def test_a_network_is_run_by_the_batch(tmp_path):
    path = str(tmp_path / 'policy.onnx')
    _save_onnx(path, [('observation', ['batch', 25])])
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
        _save_onnx_of_width_3(path)
    else:
        _save_onnx(path, inputs, outputs or [('action', [inputs[0][1][0], 4])])
    with pytest.raises(ValueError, match=message):
        policies.load(path, env)


def _save_onnx_of_width_3(path):
    onnx = pytest.importorskip('onnx')
    pytest.importorskip('onnxruntime')
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    weights = onnx.numpy_helper.from_array(np.ones((25, 3), np.float32), 'weights')
    graph = helper.make_graph(
        [helper.make_node('MatMul', ['observation', 'weights'], ['out'])],
        'policy',
        [helper.make_tensor_value_info('observation', kind, [1, 25])],
        [helper.make_tensor_value_info('out', kind, [1, 3])],
        [weights],
    )
    opset = [helper.make_opsetid('', 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)


def test_a_network_for_another_task_is_named(tmp_path):
    path = str(tmp_path / 'policy.onnx')
    _save_onnx(path, [('observation', ['batch', 25])])
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


# -- The user's own code ---------------------------------------------------------------------------

_CODE = """
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
        ('broken', RuntimeError, r'before the first step: ZeroDivisionError.*own_.*\.py, line 30'),
        ('late', RuntimeError, r'step [12]: .*The action is not finite for seed 9'),
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
