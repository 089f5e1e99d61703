"""TorchRL: both faces hold their specs, and agree."""

import pathlib
import runpy

import pytest

pytest.importorskip('torchrl', reason="TorchRL is not installed: pip install -e '.[torchrl]'")

import gymnasium as gym  # noqa: E402
import torch  # noqa: E402
from torchrl.envs import DMControlEnv, DMControlWrapper, GymEnv, GymWrapper  # noqa: E402
from torchrl.envs.utils import check_env_specs  # noqa: E402

import fetch_composer  # noqa: E402

pytestmark = [
    pytest.mark.clients,
    pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning'),
]
_EXAMPLE = pathlib.Path(__file__).parents[2] / 'examples/torchrl_specs.py'


@pytest.fixture
def envs(task_name):
    environments = runpy.run_path(str(_EXAMPLE))['make_envs'](task_name)
    yield environments
    for env in environments.values():
        env.close()


def test_specs_hold(envs):
    for env in envs.values():
        check_env_specs(env)


def test_environments_can_be_named(task_name):
    camel_case = ''.join(word.capitalize() for word in task_name.split('_'))
    check_env_specs(GymEnv(f'fetch_composer/Fetch{camel_case}-v2'))
    check_env_specs(DMControlEnv('fetch', task_name))


def test_episodes_are_truncated_and_never_terminated(envs):
    for env in envs.values():
        following = env.rollout(60)['next']
        assert following['truncated'].flatten().tolist() == [False] * 49 + [True]
        assert not following['terminated'].any()


def test_both_faces_start_from_a_seed_alike(envs):
    starts = []
    for env in envs.values():
        env.set_seed(7)
        starts.append(env.reset())
    for name in 'observation', 'achieved_goal', 'desired_goal':
        torch.testing.assert_close(starts[0][name], starts[1][name], rtol=0, atol=0)


def test_the_native_batch_is_an_environment_of_its_size():
    made = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=3, autoreset_mode='Disabled')
    env = GymWrapper(made)
    assert env.batch_size == (3,)
    check_env_specs(env)
    following = env.rollout(60, break_when_any_done=False)['next']
    assert following['observation'].shape == (3, 60, 25)
    assert following['truncated'].squeeze(-1).tolist() == [[i == 49 for i in range(60)]] * 3


def test_the_native_batch_must_not_start_episodes_by_itself():
    """Of Gymnasium's own vector TorchRL says the same; when this fails, the document is old."""
    for mode, message in (('NextStep', 'DISABLED'), ('SameStep', 'StopIteration')):
        with pytest.raises(RuntimeError, match=message):
            made = gym.make_vec('fetch_composer/FetchPush-v2', 3, autoreset_mode=mode)
            GymWrapper(made).rollout(60, break_when_any_done=False)


def test_a_plain_wrapper_still_refuses_composer():
    """When this fails, the example no longer needs a class of its own."""
    with pytest.raises(TypeError, match='dm_control.rl.control.Environment'):
        DMControlWrapper(fetch_composer.load('push'))


def test_the_example_runs(run_example):
    printed = run_example('torchrl_specs.py', '--task=reach')
    assert 'DMControlWrapper: specs hold; 50 random steps' in printed
    assert 'GymWrapper: specs hold; 50 random steps' in printed
