"""States: what follows a restored one is, to the bit, what followed when it was taken."""

import dataclasses
import pathlib
import pickle
import runpy
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer.tasks.state import State
from tests import episodes

_VARIATIONS = {
    'object_size': distributions.Uniform(0.02, 0.03),
    'object_mass': distributions.Uniform(1.0, 3.0),
    'friction': distributions.Uniform(0.3, 1.0),
}


@pytest.fixture(params=[False, True], ids=['plain', 'varied'])
def options(request, task_name, convention):
    varied = request.param and task_name != 'reach'
    return {'convention': convention, 'variations': _VARIATIONS if varied else None}


def _taken(env, steps=17):
    """Returns a state within the second episode, and what follows it, two resets included."""
    episodes.run(env, episodes.uniform_actions(51 + steps, seed=1))
    state = env.get_state()
    return state, [env.step(action) for action in episodes.uniform_actions(90, seed=2)]


def _follows(env):
    return [env.step(action) for action in episodes.uniform_actions(90, seed=2)]


def _begun(variations):
    """Returns an environment of Push and a batch of two, in their first episodes."""
    env = fetch_composer.load('push', seed=0, variations=variations)
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0, variations=variations)
    env.reset()
    batch.reset()
    return env, batch


def test_the_same_environment_goes_on_as_it_did(task_name, options):
    env = episodes.shared(task_name, 3, **options)
    state, expected = _taken(env)
    for _ in range(2):
        env.set_state(state)
        episodes.assert_same(_follows(env), expected)


@pytest.mark.parametrize('steps', [0, 17, 49])
def test_another_environment_goes_on_as_the_first_did(task_name, options, steps, tmp_path):
    state, expected = _taken(episodes.shared(task_name, 3, **options), steps)
    state.save(tmp_path / 'state.npz')
    for copied in (pickle.loads(pickle.dumps(state)), State.load(tmp_path / 'state.npz')):
        other = episodes.shared(task_name, 8, number=1, **options)
        other.set_state(copied)
        episodes.assert_same(_follows(other), expected)


def test_a_batch_goes_on_as_single_environments_and_they_as_it(task_name, options):
    singles = [episodes.shared(task_name, i, number=i, **options) for i in range(2)]
    taken = [_taken(single, 10 + i) for i, single in enumerate(singles)]
    batch = fetch_composer.BatchEnvironment(task_name, 3, seed=50, **options)
    batch.reset()
    batch.set_states([state for state, _ in taken], [2, 0])
    back = singles[1]  # Elsewhere by now.
    (again,) = batch.get_states([2])
    back.set_state(again)
    episodes.assert_same(_follows(back), taken[0][1])
    for i, action in enumerate(episodes.uniform_actions(90, seed=2)):
        time_step = batch.step(np.tile(action, (3, 1)))
        for row, (_, expected) in ((2, taken[0]), (0, taken[1])):
            assert time_step.step_type[row] == expected[i].step_type
            for name, value in expected[i].observation.items():
                np.testing.assert_array_equal(time_step.observation[name][row], value)


@pytest.mark.parametrize('num_envs', [1, 4])
def test_one_state_has_as_many_futures_as_one_likes(task_name, convention, num_envs):
    batch = fetch_composer.BatchEnvironment(task_name, num_envs, seed=0, convention=convention)
    batch.reset()
    for actions in episodes.uniform_actions(12, batch_shape=(num_envs,)):
        batch.step(actions)
    (state,) = batch.get_states([0])
    batch.set_states([state] * num_envs)
    for action in episodes.uniform_actions(60, seed=4):
        observation = batch.step(np.tile(action, (num_envs, 1))).observation['observation']
        np.testing.assert_array_equal(observation, observation[:1].repeat(num_envs, axis=0))


def test_what_was_given_for_the_next_episode_is_part_of_it():
    env = fetch_composer.load('push', seed=0)
    episodes.run(env, episodes.uniform_actions(5))
    env.task.set_next_episode(goal=(1.2, 0.7, 0.43))
    state = env.get_state()
    other = fetch_composer.load('push', seed=1)
    other.set_state(state)
    np.testing.assert_array_equal(other.reset().observation['desired_goal'], (1.2, 0.7, 0.43))


_OTHER_PROCESS = """
import sys
import fetch_composer
from fetch_composer.tasks.state import State
from tests import episodes
env = fetch_composer.load('slide', seed=77)
env.set_state(State.load(sys.argv[1]))
steps = [env.step(action) for action in episodes.uniform_actions(60, seed=2)]
print([value.hex() for step in steps for value in step.observation['observation']])
"""


def test_another_process_goes_on_as_the_first_did(tmp_path):
    state, expected = _taken(fetch_composer.load('slide', seed=3))
    state.save(tmp_path / 'state.npz')
    command = [sys.executable, '-c', _OTHER_PROCESS, str(tmp_path / 'state.npz')]
    result = subprocess.run(command, capture_output=True, text=True)
    values = [v.hex() for step in expected[:60] for v in step.observation['observation']]
    assert result.stdout.strip() == str(values), result.stderr


def test_a_state_of_another_environment_is_refused_and_nothing_changes():
    env = fetch_composer.load('push', seed=0)
    actions = episodes.uniform_actions(8)
    episodes.run(env, actions)
    kept = env.get_state()
    expected = _follows(env)
    varied = fetch_composer.load('push', seed=0, variations={'object_mass': 1.0})
    reach = fetch_composer.load('reach', seed=0)
    for other in varied, reach:
        other.reset()
    refused = [
        (reach.get_state(), r"task_name \('reach', not 'push'\)"),
        (varied.get_state(), 'varies object_mass; this environment varies nothing'),
        (dataclasses.replace(kept, version='3.0'), r"version \('3.0', not"),
        (dataclasses.replace(kept, convention='gymnasium_robotics'), 'convention'),
        ('state', 'A State is needed'),
        (
            fetch_composer.load('push', seed=np.random.RandomState(0)).get_state(),
            "generator of kind 'MT19937'",
        ),
    ]
    env.set_state(kept)
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0)
    batch.reset()
    for state, message in refused:
        with pytest.raises(ValueError, match=message):
            env.set_state(state)
        with pytest.raises(ValueError, match=message):
            batch.set_states([kept, state])
    with pytest.raises(ValueError, match='2 states are needed, got 1'):
        batch.set_states([kept])
    episodes.assert_same(_follows(env), expected)


def test_a_state_made_by_hand_that_cannot_be_is_refused_and_nothing_changes():
    env, batch = _begun({'object_mass': distributions.Uniform(1.0, 3.0)})
    kept, kept_rows = env.get_state(), batch.get_states()
    expected, expected_rows = _follows(env), episodes.run(batch, np.ones((3, 2, 4)))
    env.set_state(kept)
    batch.set_states(kept_rows)
    refused = [
        ({'physics': kept.physics[:-1]}, 'physics of the state must be finite numbers of shape'),
        ({'physics': np.full_like(kept.physics, np.nan)}, 'physics of the state must be finite'),
        ({'physics': None}, 'physics of the state must be finite'),
        ({'gripper_pose': np.zeros(6)}, r'gripper_pose of the state .* shape \(7,\)'),
        ({'goal': np.zeros(2)}, r'goal of the state .* shape \(3,\)'),
        ({'steps_taken': -1}, 'steps_taken of the state must be a non-negative integer'),
        ({'steps_taken': 1.5}, 'steps_taken of the state'),
        ({'is_over': 1}, 'is_over of the state must be True or False'),
        ({'variations': {'object_mass': np.array((1.0, 2.0))}}, "'object_mass' drew"),
        ({'variations': {'object_mass': 2.0}}, "'object_mass' of the state must be an array"),
        ({'variations': {}}, 'The state varies nothing'),
        ({'given': {'position': (1, 2)}}, 'valid are object_position, goal'),
        ({'given': {'goal': (9, 9, 9)}}, 'off the table'),
        ({'generator': None}, 'generator of kind None'),
        ({'generator': {**kept.generator, 'state': np.array(1.0)}}, 'not one of PCG64'),
        ({'generator': {'bit_generator': 'PCG64'}}, 'generator is not one of PCG64'),
    ]
    for change, message in refused:
        state = dataclasses.replace(kept, **change)
        with pytest.raises(ValueError, match=message):
            env.set_state(state)
        with pytest.raises(ValueError, match=message):
            batch.set_states([kept, state])
    episodes.assert_same(_follows(env), expected)
    episodes.assert_same(episodes.run(batch, np.ones((3, 2, 4))), expected_rows)


def test_a_refused_state_leaves_an_environment_that_was_never_reset_as_it_was():
    varied = fetch_composer.load('push', seed=0, variations={'object_mass': 1.0})
    varied.reset()
    env = fetch_composer.load('push', seed=4)
    with pytest.raises(ValueError, match='varies object_mass'):
        env.set_state(varied.get_state())
    episodes.assert_same([env.reset()], [fetch_composer.load('push', seed=4).reset()])


@pytest.mark.parametrize('content', [b'', b'PK\x03\x04 cut off'])
def test_a_file_that_holds_no_state_is_named(tmp_path, content):
    path = tmp_path / 'state.npz'
    path.write_bytes(content)
    with pytest.raises(ValueError, match='state.npz does not hold the state'):
        State.load(path)


def test_through_gymnasium():
    env = gym.make('fetch_composer/FetchPush-v4').unwrapped
    env.reset(seed=0)
    actions = episodes.uniform_actions(10)
    for action in actions:
        env.step(action)
    state = env.get_state()
    expected = [env.step(action)[0]['observation'] for action in actions]
    env.set_state(state)
    np.testing.assert_array_equal([env.step(a)[0]['observation'] for a in actions], expected)
    vector = gym.make_vec('fetch_composer/FetchPush-v4', num_envs=2)
    vector.reset(seed=5)
    vector.set_states([state, state])
    np.testing.assert_array_equal(vector.get_states([1])[0].physics, state.physics)
    for action, value in zip(actions, expected, strict=True):
        observation = vector.step(np.tile(action, (2, 1)))[0]['observation']
        np.testing.assert_array_equal(observation, [value, value])


def test_gymnasium_draws_on_and_starts_where_it_was_to_even_before_its_first_reset():
    source = fetch_composer.load('push', seed=3)
    source.reset()
    drawn = source.get_state()
    source.task.set_next_episode(goal=(1.2, 0.7, 0.43))
    given = source.get_state()
    for state in (drawn, given):
        source.set_state(state)
        env = gym.make('fetch_composer/FetchPush-v2').unwrapped
        env.set_state(state)
        expected = source.reset().observation['desired_goal']
        np.testing.assert_array_equal(env.reset()[0]['desired_goal'], expected)


def test_a_state_shares_no_array_with_its_environment():
    env, batch = _begun({'friction': distributions.Uniform(0.3, 1.0)})
    env.task.set_next_episode(goal=(1.2, 0.7, 0.43))
    expected = env.get_state()
    batch.set_states([expected], [1])

    def taken():
        return [env.get_state(), *batch.get_states([1])]

    for state in taken():
        assert state == expected
        env.set_state(state)
        batch.set_states([state], [1])
        state.variations['friction'][:] = 9
        state.given['goal'][:] = 9
        for array in (state.physics, state.gripper_pose, state.goal):
            array[:] = 9
        assert state != expected
        assert taken() == [expected] * 2


@pytest.mark.parametrize('num_envs', [1, 3])
def test_a_row_that_is_restored_is_observed_as_it_was(task_name, convention, num_envs):
    batch = fetch_composer.BatchEnvironment(task_name, num_envs, seed=0, convention=convention)
    batch.reset()
    for actions in episodes.uniform_actions(9, batch_shape=(num_envs,)):
        expected = batch.step(actions).observation
    states = batch.get_states()
    batch.step(np.ones((num_envs, 4)))
    batch.set_states(states)
    for name, value in batch.reset([]).observation.items():
        np.testing.assert_allclose(value, expected[name], rtol=0, atol=1e-15, err_msg=name)


def test_an_environment_that_has_not_begun_has_a_state_too():
    env = fetch_composer.load('push', seed=2, variations=_VARIATIONS)
    batch = fetch_composer.BatchEnvironment('push', 2, seed=2, variations=_VARIATIONS)
    expected = fetch_composer.load('push', seed=2, variations=_VARIATIONS).reset()
    env.set_state(env.get_state())
    batch.set_states(batch.get_states())
    episodes.assert_same([env.reset()], [expected])
    np.testing.assert_array_equal(
        batch.reset().observation['observation'][0], expected.observation['observation']
    )


def test_a_state_is_restored_where_no_start_was_possible():
    options = {
        'object_position': (1.3419, 0.7491),
        'variations': {'gripper_offset': distributions.Uniform((0, 0, -0.11), (0, 0, 0))},
    }
    source, env, fresh = (fetch_composer.load('push', seed=s, **options) for s in (0, 3, 3))
    source.reset()
    state = source.get_state()
    expected = source.step(np.ones(4))
    with pytest.raises(ValueError, match='is where the gripper starts'):
        env.reset()
    for each in (env, fresh):
        each.set_state(state)
        episodes.assert_same([each.step(np.ones(4))], [expected])


def test_the_example_finds_a_plan_that_is_better_than_none():
    example = runpy.run_path(str(pathlib.Path(__file__).parents[1] / 'examples/planning.py'))
    env = fetch_composer.load('push', seed=1000)
    env.reset()
    state = env.get_state()
    batch = fetch_composer.BatchEnvironment('push', 64, seed=0, max_episode_steps=None)
    nothing = np.zeros((5, 4))
    plan = example['plan'](batch, state, nothing, np.random.default_rng(0))

    def cost(knots):
        batch.set_states([state], [0])
        taken = [batch.step(np.tile(knot, (64, 1))) for knot in knots for _ in range(3)]
        return sum(example['cost'](each.observation)[0] for each in taken)

    assert cost(plan) < 0.9 * cost(nothing)


def test_a_state_whose_sizes_do_not_fit_the_shape_is_refused_and_nothing_changes():
    env, batch = _begun({'object_size': distributions.Uniform((0.02,) * 3, (0.03,) * 3)})
    kept, kept_rows = env.get_state(), batch.get_states()
    bad = dataclasses.replace(kept, variations={'object_size': np.array((0.02, 0.03))})
    with pytest.raises(ValueError, match='this object has 3 sizes'):
        env.set_state(bad)
    with pytest.raises(ValueError, match='this object has 3 sizes'):
        batch.set_states([kept, bad])
    assert env.get_state() == kept and batch.get_states() == kept_rows
