"""Bad input is refused with a message that says what is valid, and changes nothing."""

import numpy as np
import pytest
from dm_control import suite as dm_suite

import fetch_composer
from fetch_composer import entities, suite, tasks
from fetch_composer.tasks import push_two
from tests import episodes

_BAD_ACTIONS = [
    (np.full(4, np.nan), 'must be finite'),
    (np.array([0, np.inf, 0, 0]), 'must be finite'),
    (np.zeros(3), r'shape \(4,\) is needed, got \(3,\)'),
    (np.zeros((1, 4)), r'shape \(4,\) is needed'),
    (0.5, r'shape \(4,\) is needed'),
    (None, r'shape \(4,\) is needed'),
    (['a', 'b', 'c', 'd'], 'floats'),
    (np.ma.array(np.ones(4), mask=[1, 0, 0, 0]), 'masked values'),
    ([True, 0, 0, 0], 'must be numbers'),
    ([[0], 0, 0, 0], 'is no array'),
    ([10**400, 0, 0, 0], 'floats'),
]


def _two(task_name, **options):
    return (episodes.shared(task_name, number=i, **options) for i in range(2))


def test_a_bad_action_leaves_the_simulation_untouched(task_name, convention):
    env, reference = _two(task_name, convention=convention)
    actions = episodes.uniform_actions(5 + len(_BAD_ACTIONS))
    expected = episodes.run(reference, actions)
    time_steps = episodes.run(env, actions[:5])
    for (action, message), good in zip(_BAD_ACTIONS, actions[5:], strict=True):
        with pytest.raises(ValueError, match=message):
            env.step(action)
        time_steps.append(env.step(good))
    episodes.assert_same(time_steps, expected)


def test_actions_outside_the_range_are_clipped(task_name, convention):
    env, reference = _two(task_name, convention=convention)
    wild = 5 * episodes.uniform_actions(10)
    episodes.assert_same(episodes.run(env, wild), episodes.run(reference, np.clip(wild, -1, 1)))


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'convention': 'gym'}, 'valid are documented, gymnasium_robotics'),
        ({'reward_type': 'shaped'}, 'valid are sparse, dense'),
        ({'max_episode_steps': 0}, 'positive integer'),
        ({'max_episode_steps': -3}, 'positive integer'),
        ({'max_episode_steps': 2.5}, 'positive integer'),
        ({'colour': 'red'}, "'colour'.* valid are .*reward_type"),
        ({'goal': (9, 9, 9)}, 'off the table'),
        ({'goal': (1.3, 0.75)}, '3 finite numbers'),
        ({'goal': (1.3, np.nan, 0.42)}, '3 finite numbers'),
        ({'goal': 'here'}, '3 finite numbers'),
        ({'goal': ('1.3', '0.75', '0.42')}, '3 finite numbers'),
        ({'goal': np.array([1.3, 0.75, 0.42j])}, '3 finite numbers'),
        ({'goal': (10**400, 0, 0)}, '3 finite numbers'),
        ({'goal': (10**5000, 0, 0)}, '3 finite numbers'),
        ({'goal': (1.3, True, 0.42)}, 'must be numbers'),
        ({'goal': np.ma.array([1.3, 0.75, 0.42], mask=[0, 1, 0])}, 'masked values'),
        ({'convention': [1]}, 'valid are documented, gymnasium_robotics'),
        ({'terminate_on_success': 10**5000}, 'must be True or False; got a int'),
        ({'variations': 1.0}, 'variations must be a mapping'),
        ({'variations': {5: 1}}, 'Unknown variation 5; valid are object_shape'),
    ],
)
def test_options_that_make_no_sense_are_refused(task_name, options, message):
    with pytest.raises(ValueError, match=message):
        fetch_composer.load(task_name, **options)
    with pytest.raises(ValueError, match=message):
        suite.load('fetch', task_name, task_kwargs=options)
    with pytest.raises(ValueError, match=message):
        dm_suite.load('fetch', task_name, task_kwargs=options)


@pytest.mark.parametrize('position', [(0, 0), (1.3, np.inf), (1.3,), (1.3, 0.75, 0.42)])
def test_places_that_cannot_be_leave_the_next_episode_as_it_was(object_task_name, position):
    env, reference = _two(object_task_name)
    with pytest.raises(ValueError, match='object_position'):
        env.task.set_next_episode(object_position=position)
    episodes.assert_same([env.reset()], [reference.reset()])


def test_reach_has_no_object_to_place():
    env = fetch_composer.load('reach', seed=0)
    with pytest.raises(ValueError, match='has no object'):
        env.task.set_next_episode(object_position=(1.3, 0.75))


def test_unknown_names_are_answered_with_the_valid_ones():
    for load in (fetch_composer.load, fetch_composer.BatchEnvironment):
        arguments = ('throw',) if load is fetch_composer.load else ('throw', 2)
        with pytest.raises(ValueError, match=f'valid are {", ".join(fetch_composer.ALL)}'):
            load(*arguments)
    with pytest.raises(ValueError, match="valid is 'fetch'"):
        suite.load('panda', 'push')
    with pytest.raises(ValueError, match='throw'):
        suite.load('fetch', 'throw')


@pytest.mark.parametrize(
    'seed',
    [
        -1,
        1.5,
        'a',
        True,
        np.array([1, 2]),
        np.float64(1),
        np.ma.masked,
        np.ma.array(1, mask=True),
        [1, [2]],
        [-(10**5000)],
    ],
)
def test_seeds_that_make_no_sense_are_refused(seed):
    with pytest.raises(ValueError, match='seed must be a non-negative integer'):
        fetch_composer.load('push', seed=seed)
    with pytest.raises(ValueError, match='seed must be a non-negative integer|2 seeds|3 seeds'):
        fetch_composer.BatchEnvironment('push', 3, seed=seed)


@pytest.mark.parametrize('seed', [np.int32(4), np.uint64(4), np.array(4)])
def test_seeds_of_numpy_are_taken(seed):
    expected = fetch_composer.load('push', seed=4).reset()
    episodes.assert_same([fetch_composer.load('push', seed=seed).reset()], [expected])
    observation = fetch_composer.BatchEnvironment('push', 2, seed=seed).reset().observation
    np.testing.assert_array_equal(
        observation['desired_goal'][0], expected.observation['desired_goal']
    )


def test_an_object_cannot_start_within_a_gripper_that_starts_low():
    env = fetch_composer.load('push', seed=0, convention='gymnasium_robotics')
    with pytest.raises(ValueError, match='where the gripper starts'):
        env.task.set_next_episode(object_position=(1.36, 0.76))
    # The documented gripper hovers above.
    fetch_composer.load('push', seed=0, object_position=(1.34, 0.75)).reset()


@pytest.mark.parametrize('value', [True, 'a', [True], np.ma.array([1.0], mask=True)])
def test_a_variation_that_draws_no_number_is_named(value):
    env = fetch_composer.load('push', seed=0, variations={'friction': value})
    with pytest.raises(ValueError, match="'friction'"):
        env.reset()


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'goal': np.ma.array(np.full((2, 3), 0.6), mask=True)}, 'goal has masked values'),
        ({'goal': [np.ma.array([1.3, 0.7, 0.5], mask=True)] * 2}, 'goal has masked values'),
        ({'object_position': [[1.3, True]] * 2}, 'object_position must be numbers'),
        ({'ids': np.ma.array([0, 1], mask=[1, 0])}, 'ids has masked values'),
        ({'seed': np.ma.array([0, 1], mask=[1, 0])}, 'seed must be a non-negative integer'),
        ({'seed': [0]}, '2 seeds are needed, got 1'),
    ],
)
def test_a_batch_refuses_what_would_be_taken_for_something_else(arguments, message):
    with fetch_composer.BatchEnvironment('push', 2, seed=0) as batch:
        before = batch.reset().observation
        with pytest.raises(ValueError, match=message):
            batch.reset(**arguments)
        after = batch.reset(ids=[]).observation
    for name, value in before.items():
        np.testing.assert_array_equal(value, after[name])


@pytest.mark.parametrize(
    ('goal', 'message'),
    [
        (np.ma.array([1.0, 2.0, 3.0], mask=[0, 0, 1]), 'achieved_goal has masked values'),
        ([True, False, True], 'achieved_goal must be numbers'),
        (np.zeros(3, bool), 'achieved_goal must be numbers'),
        (np.zeros(3, complex), 'achieved_goal must be numbers'),
        ([10**400, 0, 0], 'achieved_goal must be numbers'),
        (['a', 'b', 'c'], 'achieved_goal must be numbers'),
        (np.zeros((2, 3)), r'of one shape, got \(2, 3\) and \(5, 3\)'),
    ],
)
def test_a_reward_is_of_numbers_alone(goal, message):
    with pytest.raises(ValueError, match=message):
        tasks.compute_reward(goal, np.zeros((5, 3)))


@pytest.mark.parametrize('states', [None, 3, 'ab', 'one'])
def test_what_is_no_sequence_of_states_is_refused(states):
    with fetch_composer.BatchEnvironment('push', 1, seed=0) as batch:
        batch.reset()
        (state,) = batch.get_states()
        with pytest.raises(ValueError, match='states must be a sequence'):
            batch.set_states(state if states == 'one' else states)
        batch.set_states(each for each in [state])
        assert batch.get_states() == [state]


def test_a_batch_seeds_nothing_if_a_start_is_refused():
    variations = {'gripper_offset': (0, 0, -0.1)}
    batch, reference = (
        fetch_composer.BatchEnvironment('push', 2, seed=0, variations=variations) for _ in range(2)
    )
    with pytest.raises(ValueError, match='is where the gripper starts'):
        batch.reset(object_position=(1.3419, 0.7491), seed=9)
    episodes.assert_same([batch.reset()], [reference.reset()])


@pytest.mark.parametrize(
    ('which', 'message'),
    [
        (0, r'sampler of places must draw 2 numbers for each of 2, shape \(4,\); it drew'),
        (1, r'sampler of goals must draw 3 numbers for each of 2, shape \(6,\); it drew'),
    ],
)
def test_a_sampler_that_draws_too_few_numbers_is_named(which, message, monkeypatch):
    build = push_two.PushTwo._build_samplers

    def with_one_of_two(task):
        samplers = list(build(task))
        samplers[which] = lambda **_: np.ones(2)
        return samplers

    monkeypatch.setattr(push_two.PushTwo, '_build_samplers', with_one_of_two)
    with pytest.raises(ValueError, match=message):
        fetch_composer.load('push_two', seed=0).reset()


def test_a_prop_stands_at_three_numbers():
    task = fetch_composer.load('push').task
    for position in ((1.3, 0.7), (1.3, np.nan, 0.5), None):
        with pytest.raises(ValueError, match='position of a prop must be finite numbers of shape'):
            task.scene.add_prop(entities.Block(name='prop'), position)


def test_pictures_are_of_at_least_one_camera():
    with pytest.raises(ValueError, match='must name at least one camera'):
        fetch_composer.load('push', observation_mode='pixels', pixels={'cameras': ()})
