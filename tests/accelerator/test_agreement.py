"""Physics of the batch on a device against the native batch, from the same starts."""

import numpy as np
import pytest

pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

from scipy import stats  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import policies  # noqa: E402
from fetch_composer.tasks import rewards  # noqa: E402
from fetch_composer.warp_batch import as_numpy  # noqa: E402
from tests import episodes  # noqa: E402

pytestmark = pytest.mark.warp

_NUM_EPISODES, _STEPS = 500, 50


@pytest.fixture
def pair(make, task_name, convention):
    """Returns a function that makes both batches, in the same states."""
    natives = []

    def function(num_envs):
        native = fetch_composer.BatchEnvironment(task_name, num_envs, seed=0, convention=convention)
        natives.append(native)
        native.reset()
        batch = make(task_name, num_envs, seed=0, convention=convention)
        batch.reset()
        batch.set_states(native.get_states())
        return native, batch

    yield function
    for each in natives:
        each.close()


def test_a_gripper_that_touches_nothing_follows_that_of_the_native_batch(pair):
    native, batch = pair(16)
    for actions in episodes.uniform_actions(20, batch_shape=(16,)):
        actions[:, 2] = np.abs(actions[:, 2])  # Upwards, and never at the table.
        expected = native.step(actions).observation['observation'][:, :3]
        found = as_numpy(batch.step(actions)).observation['observation'][:, :3]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5)


def _policies(name, env):
    """Returns a function of observations of many, each of which has a policy of its own."""
    if name == 'trained':
        return policies.load('trained', env).act_on_batch
    each = [policies.load(name, env, seed=i) for i in range(_NUM_EPISODES)]
    for policy in each:
        policy.reset()
    return lambda observation: np.stack(
        [
            policy({key: rows[i] for key, rows in observation.items()})
            for i, policy in enumerate(each)
        ]
    )


def _ends(batch, act, observation):
    """Returns where episodes end, and whether at their goals."""
    for _ in range(_STEPS):
        observation = _of_numpy(batch.step(act(observation))).observation
    goals = observation['achieved_goal'], observation['desired_goal']
    return goals[0], rewards.is_success(*goals)


def _of_numpy(time_step):
    return time_step if isinstance(time_step.reward, np.ndarray) else as_numpy(time_step)


@pytest.mark.parametrize('policy_name', ['random', 'expert', 'trained'])
def test_policies_succeed_as_often_and_objects_end_in_the_same_places(
    pair, task_name, convention, policy_name
):
    env = fetch_composer.load(task_name, seed=0, convention=convention)
    native, batch = pair(_NUM_EPISODES)
    observation = as_numpy(batch.reset([])).observation
    ends, successes = _ends(batch, _policies(policy_name, env), observation)
    expected_ends, expected = _ends(native, _policies(policy_name, env), observation)
    print(task_name, convention, policy_name, successes.mean(), 'native', expected.mean())
    counts = [(int(each.sum()), int((~each).sum())) for each in (successes, expected)]
    assert stats.fisher_exact(counts).pvalue > 0.01
    if task_name != 'slide':  # Where a puck glides to hangs on the last digit, in MuJoCo too.
        assert np.median(np.abs(ends - expected_ends).max(axis=1)) < 1e-3
    for axis in range(3):
        one, other = (each[:, axis].astype(float).round(5) for each in (ends, expected_ends))
        assert stats.ks_2samp(one, other).pvalue > 1e-3, axis
