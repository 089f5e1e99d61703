"""What relays do while learning: they bring the gripper to the object, and shove or grip it."""

import numpy as np
import pytest

for _package in ('jax', 'optax'):
    pytest.importorskip(_package, reason="needs pip install 'fetch_composer[learn]'")

from fetch_composer import BatchEnvironment  # noqa: E402
from fetch_composer.learning import relay, settings  # noqa: E402
from tests import exploring  # noqa: E402

_NUM_ENVS = 32


class _StraightToTheGoal:
    """A policy of Reach that needs not be learned."""

    def act(self, observation, goal):
        way = np.clip((goal - observation[:, :3]) / 0.05, -1, 1)
        return np.column_stack([way, np.zeros(len(way))])


class _DoNothing:
    def act(self, observation, goal):
        return np.zeros((len(observation), 4), np.float32)


class _Recorder(_StraightToTheGoal):
    """Keeps what it was shown."""

    def __init__(self):
        self.observations, self.goals = [], []

    def act(self, observation, goal):
        self.observations.append(observation)
        self.goals.append(goal)
        return super().act(observation, goal)


def _explore(task, convention, reach=None, start=(0,) * 10, **changes):
    """Returns an exploring episode of each environment, by a policy that does nothing itself."""
    reaching = relay.Relay(reach or _StraightToTheGoal(), np.array(start))
    return exploring.explore(task, convention, _DoNothing(), _NUM_ENVS, relay=reaching, **changes)


def _ways_of_object(episodes):
    """Returns how far each object came along the table in m."""
    way = episodes.observations[:, -1, 3:5] - episodes.observations[:, 0, 3:5]
    return np.linalg.norm(way, axis=-1)


@pytest.mark.parametrize('convention', ['documented', 'gymnasium_robotics'])
@pytest.mark.parametrize('task', ['push', 'slide', 'pick_and_place'])
def test_relays_reach_the_object(task, convention):
    episodes = _explore(task, convention, relay_share=1.0, shove_share=0.0)
    gripper, thing = episodes.observations[..., :3], episodes.observations[..., 3:6]
    nearest = np.linalg.norm(gripper - thing, axis=-1).min(axis=1)
    assert np.mean(nearest < 0.1) > 0.8


@pytest.mark.parametrize('convention', ['documented', 'gymnasium_robotics'])
@pytest.mark.parametrize('task', ['push', 'slide'])
def test_shoves_move_the_object_far(task, convention):
    without, with_shoves = (
        _ways_of_object(_explore(task, convention, relay_share=1.0, shove_share=share))
        for share in (0.0, 1.0)
    )
    assert np.mean(with_shoves > 0.1) > np.mean(without > 0.1) + 0.15


@pytest.mark.parametrize('convention', ['documented', 'gymnasium_robotics'])
def test_grips_lift_the_object(convention):
    heights = (
        _explore(
            'pick_and_place', convention, relay_share=1.0, shove_share=0.0, grip_share=share
        ).observations[..., 5]
        for share in (0.0, 1.0)
    )
    without, with_grips = (np.mean(each.max(axis=1) > each[:, 0] + 0.05) for each in heights)
    assert without < 0.1 and with_grips > 0.5


def test_without_relays_the_policy_acts_alone():
    assert not _explore('push', 'documented', relay_share=0.0).actions.any()


def test_relays_become_fewer_as_noise_falls():
    falls = {'relay_share': 1.0, 'final_noise': 0.0, 'last_final_noise': 0.5}
    begun, done = (_explore('push', 'documented', falling=part, **falls) for part in (0.0, 1.0))
    assert begun.actions.any(axis=(1, 2)).all()
    assert not done.actions[0].any()
    # The share that is left rises from 0 in the first environment to 0.5 in the last.
    assert 0.1 < done.actions.any(axis=(1, 2)).mean() < 0.45


def test_a_shove_is_one_action_along_the_table_for_some_steps():
    episodes = _explore('push', 'documented', relay_share=1.0, shove_share=1.0)
    lengths = []
    for actions in episodes.actions:
        # The relay goes up or down as well; what follows a shove is to do nothing.
        (at,) = np.nonzero((actions[:, 2] == 0) & actions[:, :2].any(axis=1))
        lengths.append(len(at))
        assert (actions[at] == actions[at[:1]]).all()
        assert np.abs(actions[at]).max(initial=0) <= 1
    assert set(lengths) <= {0, 1, 2, 3, 4, 5}
    assert np.mean(np.array(lengths) > 0) > 0.8


def test_a_grip_closes_open_fingers_and_then_takes_one_action_for_some_steps():
    episodes = _explore(
        'pick_and_place', 'documented', relay_share=1.0, shove_share=0.0, grip_share=1.0
    )
    lengths = []
    for actions in episodes.actions:
        (at,) = np.nonzero(actions[:, 3] == -1)
        lengths.append(len(at))
        if len(at):
            assert (np.diff(at) == 1).all()
            assert (actions[: at[0], 3] == 1).all()
            assert not actions[at[:3], :3].any()
            assert (actions[at[3:]] == actions[at[3:4]]).all()
            assert not actions[at[-1] + 1 :].any()
    assert set(lengths) <= {0, *range(6, 20)}
    assert np.mean(np.array(lengths) > 0) > 0.8


@pytest.mark.parametrize('convention', ['documented', 'gymnasium_robotics'])
@pytest.mark.parametrize('task', ['push', 'slide', 'pick_and_place'])
def test_the_policy_of_reach_is_shown_what_it_knows(task, convention):
    batch = BatchEnvironment('reach', 1, convention=convention)
    known = batch.reset().observation['observation'][0]
    batch.close()
    recorder = _Recorder()
    episodes = _explore(task, convention, recorder, known, relay_share=1.0)
    start = recorder.observations[0][:, :2]
    assert start == pytest.approx(np.tile(known[:2], (len(start), 1)), abs=1e-6)
    fingers, finger_velocities = slice(3, 5), slice(8, 10)
    for part in (fingers, finger_velocities):
        shown = np.concatenate([each[:, part] for each in recorder.observations])
        assert np.unique(shown, axis=0) == pytest.approx(known[None, part])
    # It is a place next to the object that it is to reach, as seen from the gripper.
    way = recorder.goals[0] - recorder.observations[0][:, :3]
    to_object = episodes.observations[:, 0, 3:6] - episodes.observations[:, 0, :3]
    assert np.abs(way - to_object).max() < 0.061


def test_shares_of_relays_that_end_somehow_are_no_more_than_all():
    with pytest.raises(ValueError, match='shove_share and grip_share must not exceed 1 together'):
        settings.for_task('push', changes={'shove_share': 0.6, 'grip_share': 0.5})
