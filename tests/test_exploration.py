"""What an exploring policy sees, and what is kept of its episodes."""

import numpy as np
import pytest

for _package in ('jax', 'optax'):
    pytest.importorskip(_package, reason="needs pip install 'fetch_composer[learn]'")

from fetch_composer import BatchEnvironment  # noqa: E402
from tests import exploring  # noqa: E402

_NUM_ENVS, _STEPS = 64, 5


class _Recorder:
    """Does nothing, and keeps the goals that it saw."""

    def __init__(self):
        self.goals = []

    def act(self, observation, goal):
        self.goals.append(goal.copy())
        return np.zeros((len(observation), 4), np.float32)


def _explore(task, convention, **changes):
    """Returns goals as the policy saw them, (steps, num_envs, goal_size), and the episodes."""
    recorder = _Recorder()
    episodes = exploring.explore(task, convention, recorder, _NUM_ENVS, _STEPS, **changes)
    with BatchEnvironment(task, _NUM_ENVS, convention=convention) as batch:
        batch.seed(range(_NUM_ENVS))
        goals = batch.reset().observation['desired_goal']
    assert episodes.goals == pytest.approx(goals, abs=1e-6)
    return np.stack(recorder.goals), episodes


@pytest.mark.parametrize(
    'task, convention',
    [('slide', 'documented'), ('slide', 'gymnasium_robotics'), ('push_two', 'documented')],
)
def test_goal_noise_moves_what_the_policy_sees_and_not_the_goal(task, convention):
    seen, episodes = _explore(task, convention, goal_noise=0.1)
    assert (seen == seen[0]).all()  # One place for a whole episode.
    beside = (seen[0] - episodes.goals).reshape(_NUM_ENVS, -1, 3)
    assert not beside[0].any()
    assert not beside[..., 2].any()
    assert beside[-_NUM_ENVS // 4 :, :, :2].std() == pytest.approx(0.0875, rel=0.25)


def test_without_goal_noise_the_policy_sees_the_goal():
    seen, episodes = _explore('slide', 'documented', goal_noise=0.0)
    assert (seen == episodes.goals).all()
