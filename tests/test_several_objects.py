"""Tasks of several objects and of obstacles: all that is said of one object holds for each."""

import gymnasium as gym
import numpy as np
import pytest
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import policies, tasks
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.tasks import layout
from tests import episodes

TASKS = ('push_around', 'push_two', 'stack')
OF_TWO = ('push_two', 'stack')
_STEPS = 6
_VARIATIONS = {
    'object_size': distributions.Uniform(0.02, 0.026),
    'object_mass': distributions.Uniform(1.0, 3.0),
    'friction': distributions.Uniform(0.5, 1.0),
}


@pytest.fixture(params=TASKS)
def task(request) -> str:
    return request.param


@pytest.fixture(params=OF_TWO)
def task_of_two(request) -> str:
    return request.param


def _xy(goals: np.ndarray) -> np.ndarray:
    """Returns (..., n, 2) x and y of n objects from (..., 3 n)."""
    return goals.reshape(*goals.shape[:-1], -1, 3)[..., :2]


def test_an_observation_has_the_gripper_first_and_then_each_object(task_of_two):
    env = fetch_composer.load(task_of_two, seed=0)
    env.reset()
    for action in episodes.uniform_actions(3):
        observation = env.step(action).observation
    seen, sites = (
        observation['observation'],
        env.physics.bind([each.site for each in env.task.scene.objects]),
    )
    gripper = env.physics.bind(env.task.scene.gripper.tool_center_point).xpos
    places = layout.of(2)
    assert seen.shape == (40,) and places[0].size == 40
    for at, position in zip(places, sites.xpos, strict=True):
        np.testing.assert_array_equal(seen[at.grip_position], gripper)
        np.testing.assert_array_equal(seen[at.object_position], position)
        np.testing.assert_array_equal(seen[at.relative_position], gripper - position)
    np.testing.assert_array_equal(observation['achieved_goal'], sites.xpos.reshape(-1))
    taken = [slice_ for at in places for slice_ in at[1:]]
    assert sorted({i for each in taken for i in range(*each.indices(40))}) == list(range(40))


@pytest.mark.parametrize('num_envs', [1, 2])
def test_a_batch_is_as_many_single_environments(task, num_envs):
    options = {'reward_type': 'dense', 'max_episode_steps': _STEPS}
    batch = fetch_composer.BatchEnvironment(
        task, num_envs, seed=3, variations=_VARIATIONS, **options
    )
    singles = [
        episodes.shared(task, 3 + i, number=i, variations=_VARIATIONS, **options)
        for i in range(num_envs)
    ]
    expected, step = [each.reset() for each in singles], batch.reset()
    for action in episodes.uniform_actions(_STEPS + 2):
        for i, single in enumerate(expected):
            for name, value in single.observation.items():
                np.testing.assert_array_equal(step.observation[name][i], value, err_msg=name)
            assert step.reward[i] == (single.reward or 0.0)
        expected = [each.step(action) for each in singles]
        step = batch.step(np.tile(action, (num_envs, 1)))


def test_a_state_restores_everything_in_another_environment(task):
    env, other = (fetch_composer.load(task, seed=seed) for seed in (0, 1))
    env.reset()
    for action in episodes.uniform_actions(3):
        env.step(action)
    state = env.get_state()
    batch = fetch_composer.BatchEnvironment(task, 2, seed=5)
    batch.set_states([state, state])
    other.set_state(state)
    for action in episodes.uniform_actions(4, seed=7):
        expected = env.step(action)
        for name, value in other.step(action).observation.items():
            np.testing.assert_array_equal(value, expected.observation[name])
        rows = batch.step(np.tile(action, (2, 1)))
        np.testing.assert_allclose(
            rows.observation['observation'][1], expected.observation['observation'], atol=1e-12
        )
        assert rows.reward[1] == expected.reward


def test_success_is_that_of_every_object():
    goal = np.array([1.3, 0.7, 0.425, 1.4, 0.8, 0.425])
    near, far = goal + [0.04, 0, 0, 0, 0, 0.04], goal + [0.0, 0, 0, 0.03, 0, 0.05]
    np.testing.assert_array_equal(tasks.compute_reward([near, far], [goal, goal]), [0.0, -1.0])
    np.testing.assert_array_equal(tasks.is_success(np.stack((near, far)), goal), [True, False])
    dense = tasks.compute_reward([near, far], [goal, goal], 'dense')
    np.testing.assert_allclose(dense, [-np.hypot(0.04, 0.04), -np.hypot(0.03, 0.05)])
    for wrong in (np.zeros(4), np.zeros(0), np.zeros((3, 5))):
        with pytest.raises(ValueError, match=r'\(\.\.\., 3 n\) for n objects'):
            tasks.compute_reward(wrong, wrong)


@pytest.mark.parametrize('reward_type', ['sparse', 'dense'])
def test_the_reward_is_that_of_the_pure_function(task_of_two, reward_type):
    env = fetch_composer.load(task_of_two, seed=0, reward_type=reward_type)
    env.reset()
    for action in episodes.uniform_actions(4):
        step = env.step(action)
        goals = step.observation['achieved_goal'], step.observation['desired_goal']
        assert step.reward == tasks.compute_reward(*goals, reward_type)
        assert env.task.is_success() == tasks.is_success(*goals)


def test_nothing_is_in_the_way_of_anything_at_the_start(task):
    batch = fetch_composer.BatchEnvironment(task, 200, seed=0)
    observation = batch.reset().observation
    starts, goals = _xy(observation['achieved_goal']), _xy(observation['desired_goal'])
    if task == 'push_around':
        sides = np.sign(np.stack((starts, goals))[..., 0, 1] - tasks.make(task).grip_start[1])
        assert (sides[0] == -sides[1]).all() and {*sides[0]} == {-1.0, 1.0}
        return
    others = [(starts[:, 0], starts[:, 1]), (starts[:, 1], goals[:, 0])]
    if task == 'push_two':
        others += [(goals[:, 0], goals[:, 1]), (starts[:, 0], goals[:, 1])]
    assert min(np.linalg.norm(a - b, axis=-1).min() for a, b in others) >= 0.12


def test_the_blocks_of_stack_belong_on_each_other():
    goal = fetch_composer.load('stack', seed=0).reset().observation['desired_goal']
    np.testing.assert_allclose(goal[3:] - goal[:3], (0, 0, 0.05), atol=1e-12)


@pytest.mark.parametrize(
    ('task', 'position', 'message'),
    [
        ('push_two', (1.3, 0.75), '4 finite numbers'),
        ('push_two', ((1.3, 0.9), (1.4, 0.6)), '4 finite numbers'),
        ('push_two', (1.3, 0.9, 1.8, 0.6), 'off the table'),
        ('stack', (1.3, 0.9, 1.32, 0.91), r'two objects meet: .*at least 0\.071 m apart'),
        ('push_around', (1.35, 0.77), r'an obstacle stands: .*at least 0\.035 m'),
    ],
)
def test_a_start_that_cannot_be_is_refused(task, position, message):
    with pytest.raises(ValueError, match=message):
        fetch_composer.load(task, object_position=position)
    env = fetch_composer.load(task, seed=0)
    with pytest.raises(ValueError, match=message):
        env.task.set_next_episode(object_position=position)
    expected = fetch_composer.load(task, seed=0).reset().observation
    np.testing.assert_array_equal(env.reset().observation['observation'], expected['observation'])


def test_starts_and_goals_are_given_for_each_object(task_of_two):
    position, goal = (1.25, 0.6, 1.4, 0.9), (1.3, 0.7, 0.425, 1.4, 0.8, 0.425)
    env = fetch_composer.load(task_of_two, seed=0, object_position=position)
    env.task.set_next_episode(goal=goal)
    observation = env.reset().observation
    np.testing.assert_array_equal(_xy(observation['achieved_goal']).reshape(-1), position)
    np.testing.assert_array_equal(observation['desired_goal'], goal)
    batch = fetch_composer.BatchEnvironment(task_of_two, 2, seed=0)
    rows = batch.reset(object_position=position, goal=[goal, goal]).observation
    np.testing.assert_array_equal(rows['desired_goal'], [goal, goal])
    np.testing.assert_array_equal(rows['achieved_goal'][1], observation['achieved_goal'])
    with pytest.raises(ValueError, match=r'shape \(4,\) or \(2, 4\)'):
        batch.reset(object_position=(1.25, 0.6))


def test_a_wall_is_too_high_to_push_through():
    env = fetch_composer.load('push_around', seed=0, object_position=(1.3419, 0.65))
    wall = env.task.scene.obstacles[0]
    env.reset()
    for action in [(0, -1, -0.5, 0)] * 5 + [(0, 0, -1, 0)] * 3 + [(0, 1, 0, 0)] * 60:
        observation = env.step(np.array(action, np.float32)).observation
    assert 0.65 < observation['achieved_goal'][1] < wall.position[1] - wall.half_size[1]


def test_a_wall_is_low_enough_to_reach_over():
    env = fetch_composer.load('push_around', seed=0)
    wall = env.task.scene.obstacles[0]
    observation = env.reset().observation
    for beyond in (-0.15, 0.15):
        for _ in range(25):
            place = wall.position + (0.0, beyond, wall.half_size[2] + 0.03)
            observation = env.step(episodes.towards(observation, place)).observation
        reached = observation['observation'][layout.WITH_OBJECT.grip_position]
        np.testing.assert_allclose(reached, place, atol=5e-3)


@pytest.mark.parametrize('dense', ['', 'Dense'])
def test_gymnasium_has_them_with_the_length_of_their_episodes(task, dense):
    camel = ''.join(word.capitalize() for word in task.split('_'))
    spec = gym.spec(f'fetch_composer/Fetch{camel}{dense}-v0')
    assert spec.max_episode_steps == 100 == tasks.default_options(task).max_episode_steps
    env = gym.make(spec)
    assert env.observation_space['desired_goal'].shape == ((3,) if task == 'push_around' else (6,))
    observation, _ = env.reset(seed=4)
    expected = fetch_composer.load(task, seed=4).reset().observation
    for name, value in observation.items():
        np.testing.assert_array_equal(value, expected[name])


def test_a_picture_of_the_goal_shows_where_each_object_belongs():
    pixels = {'goal': True, 'height': 32, 'width': 32}
    env = fetch_composer.load('push_two', seed=0, observation_mode='pixels', pixels=pixels)

    def picture(*goal: float) -> np.ndarray:
        env.task.set_next_episode(goal=goal)
        return env.reset().observation['corner_goal_rgb']

    goal = np.array((1.3, 0.65, 0.425, 1.4, 0.85, 0.425))
    usual = picture(*goal)
    np.testing.assert_array_equal(picture(*goal), usual)
    for moved in np.eye(6)[[1, 4]]:  # Towards the camera, or away from it.
        assert (picture(*(goal - 0.1 * moved)) != usual).any()


def test_experts_are_at_the_goal_at_the_last_step(task):
    options = batch_rollout.EpisodeOptions(task, 'expert', tasks.default_options(task))
    played = batch_rollout.run_episodes(options, range(500, 516), num_threads=1)
    assert sum(each.is_success for each in played) >= 15
    # Until then they do not count on being carried: they have let go and come to rest.
    assert np.mean([each.reward[-10:].sum() == 0 for each in played]) > 0.9


def test_experts_keep_nothing_from_step_to_step(task):
    env = fetch_composer.load(task, seed=3)
    expert, step = policies.load('expert', env), env.reset()
    while not step.last():
        action = expert(step.observation)
        np.testing.assert_array_equal(policies.load('expert', env)(step.observation), action)
        assert action.dtype == np.float32 and action.shape == (4,) and np.abs(action).max() <= 1
        step = env.step(action)
