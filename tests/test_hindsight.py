"""What transitions are drawn from episodes, with which goals, and how they are normalised."""

import dataclasses

import numpy as np
import pytest

for _package in ('jax', 'optax'):
    pytest.importorskip(_package, reason="needs pip install 'fetch_composer[learn]'")

import fetch_composer  # noqa: E402
from fetch_composer.learning import networks, replay, settings  # noqa: E402


def _episodes(number=6, steps=50, seed=0):
    """Returns episodes in which the object goes for a random walk, in every other one."""
    draw = np.random.default_rng(seed)
    observations = draw.normal(size=(number, steps + 1, 25)).astype(np.float32)
    observations[..., 3:6] = np.cumsum(0.01 * observations[..., 3:6], axis=1)
    observations[::2, :, 3:6] = observations[::2, :1, 3:6]
    goals = 0.1 * draw.normal(size=(number, 3)).astype(np.float32)
    actions = draw.uniform(-1, 1, (number, steps, 4)).astype(np.float32)
    return replay.Episodes(observations, goals, actions)


def _buffer(episodes, **changes):
    as_it_was = {'mirror_share': 0.0, 'shift': 0.0}
    chosen = dataclasses.replace(settings.for_task('push'), **as_it_was | changes)
    buffer = replay.HindsightReplay(chosen, episodes.actions.shape[1], 25)
    buffer.add(episodes)
    return buffer


def test_every_reward_is_what_the_environment_gives_for_the_goal():
    drawn = _buffer(_episodes()).sample(np.random.default_rng(1), (40, 50))
    achieved = drawn.next_observation[..., 3:6]
    np.testing.assert_array_equal(drawn.reward, fetch_composer.compute_reward(achieved, drawn.goal))
    assert 0 < np.mean(drawn.reward == 0) < 1
    assert drawn.action.shape == (40, 50, 4)


def test_transitions_that_are_mirrored_and_moved_keep_their_rewards():
    buffer = _buffer(_episodes())
    elsewhere = _buffer(_episodes(), mirror_share=0.5, shift=0.1)
    expected = buffer.sample(np.random.default_rng(1), (2000,))
    drawn = elsewhere.sample(np.random.default_rng(1), (2000,))
    np.testing.assert_array_equal(drawn.reward, expected.reward)
    for part in (slice(0, 3), slice(3, 6)):
        there, here = drawn.next_observation[:, part], expected.next_observation[:, part]
        np.testing.assert_array_equal(there[:, 2], here[:, 2])
        assert (there[:, :2] != here[:, :2]).mean() > 0.99
    way = np.abs(drawn.goal - drawn.next_observation[:, 3:6])
    expected_way = np.abs(expected.goal - expected.next_observation[:, 3:6])
    np.testing.assert_allclose(way, expected_way, atol=1e-5)
    mirrored = drawn.action[:, 1] == -expected.action[:, 1]
    assert 0.4 < mirrored.mean() < 0.6
    np.testing.assert_array_equal(drawn.action[~mirrored], expected.action[~mirrored])
    np.testing.assert_array_equal(drawn.observation[~mirrored, 14:20],
                                  expected.observation[~mirrored, 14:20])  # fmt: skip
    np.testing.assert_array_equal(
        drawn.observation[mirrored, 15], -expected.observation[mirrored, 15]
    )


def test_a_goal_chosen_in_hindsight_is_achieved_later_in_the_same_episode():
    episodes = _episodes()
    buffer = _buffer(episodes, hindsight_share=1.0, moved_share=0.0)
    drawn = buffer.sample(np.random.default_rng(1), (300,))
    for observation, goal in zip(drawn.observation, drawn.goal, strict=True):
        (episode,), (time,) = np.nonzero((episodes.observations == observation).all(-1))
        later = episodes.observations[episode, time + 1 :, 3:6]
        assert (later == goal).all(-1).any()


def test_a_return_of_several_steps_sums_their_rewards_up_to_the_end_of_the_episode():
    episodes = _episodes()
    buffer = _buffer(episodes, return_steps=4, discount=0.9)
    drawn = buffer.sample(np.random.default_rng(1), (400,))
    seen_at_the_end = 0
    for i in range(400):
        (episode,), (time,) = np.nonzero((episodes.observations == drawn.observation[i]).all(-1))
        after = episodes.observations[episode, time + 1 : time + 5]
        achieved = fetch_composer.compute_reward(after[:, 3:6], drawn.goal[i])
        expected = sum(0.9**k * reward for k, reward in enumerate(achieved))
        assert drawn.reward[i] == pytest.approx(expected, abs=1e-6)
        assert drawn.discount[i] == pytest.approx(0.9 ** len(after), abs=1e-6)
        np.testing.assert_array_equal(drawn.next_observation[i], after[-1])
        seen_at_the_end += len(after) < 4
    assert seen_at_the_end > 0


def test_without_hindsight_goals_are_the_episodes_own():
    episodes = _episodes()
    drawn = _buffer(episodes, hindsight_share=0.0).sample(np.random.default_rng(1), (300,))
    assert {tuple(goal) for goal in drawn.goal} <= {tuple(goal) for goal in episodes.goals}


def test_each_half_of_a_run_has_its_share_of_goals_in_hindsight():
    episodes = _episodes()
    own = {tuple(goal) for goal in episodes.goals}
    buffer = _buffer(episodes, late_hindsight_share=0.4)
    for is_late, share in ((False, 0.8), (True, 0.4)):
        drawn = buffer.sample(np.random.default_rng(1), (4000,), is_late)
        found = np.mean([tuple(goal) not in own for goal in drawn.goal])
        assert abs(found - share) < 0.03


def test_the_share_from_episodes_that_moved_the_object_is_kept():
    episodes = _episodes(number=20)
    for share in (0.0, 0.8):
        buffer = _buffer(episodes, moved_share=share, hindsight_share=0.0)
        drawn = buffer.sample(np.random.default_rng(1), (4000,))
        moved = {tuple(goal) for goal in episodes.goals[1::2]}
        found = np.mean([tuple(goal) in moved for goal in drawn.goal])
        assert abs(found - (share + (1 - share) / 2)) < 0.03


def test_the_share_of_moments_near_the_object_is_kept():
    episodes = _episodes(number=20)
    beside = episodes.observations[..., 3:5] + 0.06
    is_near = np.random.default_rng(2).random((20, 51, 1)) < 0.2
    episodes.observations[..., :2] = np.where(is_near, episodes.observations[..., 3:5], beside)
    expected = is_near[:, :-1].mean()
    buffer = _buffer(episodes, moved_share=0.0, near_share=0.5)
    for is_late, share in ((False, 0.0), (True, 0.5)):
        if is_late:  # What is near follows from what is kept.
            buffer.restore(buffer.state())
        drawn = buffer.sample(np.random.default_rng(1), (4000,), is_late).observation
        found = np.mean((drawn[:, :2] == drawn[:, 3:5]).all(-1))
        assert abs(found - (share + (1 - share) * expected)) < 0.03


def test_where_no_moment_is_near_the_object_transitions_are_drawn_all_the_same():
    episodes = _episodes()
    episodes.observations[..., :2] = episodes.observations[..., 3:5] + 1
    drawn = _buffer(episodes, near_share=1.0).sample(np.random.default_rng(1), (200,), is_late=True)
    assert np.isfinite(drawn.reward).all()


def test_new_episodes_take_the_place_of_the_oldest():
    first, second = _episodes(seed=0), _episodes(seed=1)
    buffer = _buffer(first, replay_episodes=6, hindsight_share=0.0)
    buffer.add(second)
    drawn = buffer.sample(np.random.default_rng(1), (200,))
    assert len(buffer) == 6
    assert {tuple(goal) for goal in drawn.goal} == {tuple(goal) for goal in second.goals}


def test_features_are_normalised():
    episodes = _episodes(number=50)
    statistics = networks.FeatureStatistics(networks.num_features(25))
    statistics.add(episodes.observations, episodes.goals)
    goals = np.broadcast_to(episodes.goals[:, None], (50, 51, 3))
    seen = np.asarray(statistics.scale().normalize(episodes.observations, goals))
    np.testing.assert_allclose(seen.mean((0, 1)), 0, atol=0.02)
    np.testing.assert_allclose(seen.std((0, 1)), 1, atol=0.02)
