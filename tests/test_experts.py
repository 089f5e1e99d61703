"""Experts solve their tasks, in either convention, from what they observe alone."""

import numpy as np
import pytest

import fetch_composer
from fetch_composer import tasks
from fetch_composer.policies.experts.pick_and_place import PickAndPlaceExpert
from fetch_composer.policies.experts.reach import ReachExpert
from fetch_composer.policies.experts.slide import SlideExpert
from fetch_composer.tasks import is_success

EXPERTS = {
    'pick_and_place': PickAndPlaceExpert,
    'reach': ReachExpert,
    'slide': SlideExpert,
}
WITH_OBJECT = ('pick_and_place', 'slide')
CONVENTIONS = ('documented', 'gymnasium_robotics')

NUM_EPISODES = 40
MAY_FAIL = 2  # Of these, on another machine: contacts amplify the last digit.


def rows(observation):
    """Returns one environment's observation after the other."""
    num_envs = len(observation['desired_goal'])
    return [{name: array[i] for name, array in observation.items()} for i in range(num_envs)]


def play(batch, time_step, expert_class, see=lambda observation: observation, disturb=None):
    """Returns the actions, (steps, n, 4), and the last time step of an episode."""
    experts = [expert_class() for _ in range(batch.num_envs)]
    actions = []
    while not time_step.last().all():
        observations = rows(time_step.observation)
        action = np.array([e(see(o)) for e, o in zip(experts, observations, strict=True)])
        if disturb is not None:
            action = disturb(len(actions), action)
        actions.append(action)
        time_step = batch.step(action)
    return np.array(actions), time_step


def successes(time_step):
    observation = time_step.observation
    return is_success(observation['achieved_goal'], observation['desired_goal'])


@pytest.mark.parametrize('convention', CONVENTIONS)
@pytest.mark.parametrize('task', EXPERTS)
def test_is_at_the_goal_at_the_last_step(task, convention):
    with fetch_composer.BatchEnvironment(
        task, NUM_EPISODES, num_threads=1, seed=500, convention=convention
    ) as batch:
        _, last = play(batch, batch.reset(), EXPERTS[task])
    allowed = 0 if task == 'reach' else MAY_FAIL
    assert np.count_nonzero(~successes(last)) <= allowed


@pytest.mark.parametrize('task', EXPERTS)
def test_actions_are_what_the_task_asks_for(task):
    with fetch_composer.BatchEnvironment(task, 4, num_threads=1, seed=0) as batch:
        actions, _ = play(batch, batch.reset(), EXPERTS[task])
    assert actions.shape == (50, 4, 4)
    assert actions.dtype == np.float32
    assert np.abs(actions).max() <= 1


@pytest.mark.parametrize('task', EXPERTS)
def test_after_a_reset_plays_the_same_episode_the_same_way(task):
    expert = EXPERTS[task]()
    played = []
    for _ in range(2):
        env = fetch_composer.load(task, seed=3)
        expert.reset()
        time_step, actions = env.reset(), []
        while not time_step.last():
            actions.append(expert(time_step.observation))
            time_step = env.step(actions[-1])
        played.append(actions)
        env.close()
    np.testing.assert_array_equal(*played)


@pytest.mark.parametrize('task', WITH_OBJECT)
def test_does_not_ask_which_way_the_difference_of_positions_points(task):
    def unsee(observation):
        seen = observation['observation'].copy()
        seen[6:9] = np.nan
        return observation | {'observation': seen}

    with fetch_composer.BatchEnvironment(task, 4, num_threads=1, seed=0) as batch:
        actions, _ = play(batch, batch.reset(), EXPERTS[task])
    with fetch_composer.BatchEnvironment(task, 4, num_threads=1, seed=0) as batch:
        blind, _ = play(batch, batch.reset(), EXPERTS[task], see=unsee)
    np.testing.assert_array_equal(actions, blind)


def corners_of_the_table(task):
    workspace = tasks.make(task).workspace
    half_size = np.array(workspace.table_half_size)
    corners = half_size * [(-1, -1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, 1)]
    return np.array(workspace.table_position) + corners


@pytest.mark.parametrize('task', WITH_OBJECT)
def test_acts_on_goals_that_it_cannot_bring_the_object_to(task):
    with fetch_composer.BatchEnvironment(task, 4, num_threads=1, seed=0) as batch:
        # Whatever it divides by: the batch refuses an action that is not finite.
        play(batch, batch.reset(goal=corners_of_the_table(task)), EXPERTS[task])


def test_reaches_for_the_corners_of_the_table_as_far_as_the_arm_goes():
    with fetch_composer.BatchEnvironment('reach', 4, num_threads=1, seed=0) as batch:
        _, last = play(batch, batch.reset(goal=corners_of_the_table('reach')), ReachExpert)
    assert successes(last).all()


@pytest.mark.parametrize('goal_x', (1.12, 1.25, 1.4, 1.6, 1.71))
def test_slides_to_goals_near_and_far(goal_x):
    goals = [(goal_x, y, 0.42) for y in (0.46, 0.6, 0.75, 0.9, 1.04)]
    with fetch_composer.BatchEnvironment('slide', len(goals), num_threads=1, seed=7) as batch:
        _, last = play(batch, batch.reset(goal=goals), SlideExpert)
    assert successes(last).all()


def test_slides_by_a_single_hit():
    with fetch_composer.BatchEnvironment('slide', 1, num_threads=1, seed=0) as batch:
        actions, last = play(batch, batch.reset(goal=(1.6, 0.75, 0.42)), SlideExpert)
    moving = np.flatnonzero(np.abs(actions[:, 0]).max(axis=-1) > 0)
    assert successes(last).all()
    assert moving[-1] < 30  # From then on the puck glides by itself.


def test_picks_up_a_block_that_it_dropped():
    def drop(step, action):
        if step in (15, 16, 17):
            action[:, 2:] = (0, 1)  # Opens the gripper in mid-air.
        return action

    goal = (1.3, 0.8, 0.6)
    with fetch_composer.BatchEnvironment('pick_and_place', 8, num_threads=1, seed=0) as batch:
        _, last = play(batch, batch.reset(goal=goal), PickAndPlaceExpert, disturb=drop)
    assert np.count_nonzero(successes(last)) >= 7
