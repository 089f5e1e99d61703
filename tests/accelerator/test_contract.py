"""The batch on a device: its time steps, resets, starts, states and refusals."""

import dataclasses
import itertools

import dm_env
import numpy as np
import pytest

wp = pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

from dm_control.rl import control  # noqa: E402
from scipy import stats  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import tasks  # noqa: E402
from fetch_composer.tasks.state import State  # noqa: E402
from fetch_composer.warp_batch import as_jax, as_numpy, philox  # noqa: E402
from tests import episodes  # noqa: E402

pytestmark = pytest.mark.warp

_NUM_ENVS = 3
_ROUNDING = 1e-6  # The order in which a GPU adds numbers up is not the same each time.


def _zeros(batch):
    return np.zeros((batch.num_envs, 4), np.float32)


def _observation(time_step):
    return as_numpy(time_step).observation['observation']


@wp.kernel(enable_backward=False)
def _blocks(
    counters: wp.array(dtype=philox.Block),
    keys: wp.array(dtype=philox.Key),
    words: wp.array(dtype=philox.Block),
):
    i = wp.tid()
    words[i] = philox.block(counters[i], keys[i])


def test_the_generator_gives_the_answers_that_its_authors_publish(device):
    """From kat_vectors of Random123."""
    ones = 0xFFFFFFFF
    counters = [[0] * 4, [ones] * 4, [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344]]
    keys = [[0] * 2, [ones] * 2, [0xA4093822, 0x299F31D0]]
    expected = [
        [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8],
        [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ]
    with wp.ScopedDevice(device):
        words = wp.zeros(3, dtype=philox.Block)
        arguments = [
            wp.array(np.array(counters, np.uint32), dtype=philox.Block),
            wp.array(np.array(keys, np.uint32), dtype=philox.Key),
            words,
        ]
        wp.launch(_blocks, dim=3, inputs=arguments)
    np.testing.assert_array_equal(words.numpy(), np.array(expected, np.uint32))


def test_specs_describe_the_time_steps(make, task_name, convention):
    batch = make(task_name, 2, seed=0, convention=convention)
    assert batch.action_spec().shape == (2, 4)
    batch.reset()
    time_step = as_numpy(batch.step(_zeros(batch)))
    for name, spec in batch.observation_spec().items():
        spec.validate(time_step.observation[name])
    batch.reward_spec().validate(time_step.reward)
    batch.discount_spec().validate(time_step.discount)
    assert batch.num_envs == 2


def test_an_episode_has_the_steps_that_dm_env_has(make, task_name):
    batch = make(task_name, 2, seed=0, max_episode_steps=3)
    time_steps = [batch.reset(), *(batch.step(_zeros(batch)) for _ in range(7))]
    types = [as_numpy(each.step_type)[0] for each in time_steps]
    first, mid, last = dm_env.StepType
    assert types == [first, mid, mid, last, first, mid, mid, last]
    assert as_numpy(time_steps[4].reward).tolist() == [0, 0]
    for each in time_steps:
        assert as_numpy(each.discount).tolist() == [1, 1]


def test_a_new_batch_starts_with_its_first_step(make):
    batch = make('push', 2, seed=0)
    stepped = as_numpy(batch.step(_zeros(batch)))
    assert (stepped.step_type == dm_env.StepType.FIRST).all()
    again = as_numpy(make('push', 2, seed=0).reset())
    for name, value in stepped.observation.items():
        np.testing.assert_array_equal(value, again.observation[name])


def test_environments_that_end_at_different_times_start_anew_each_on_its_own(make):
    batch = make('push', _NUM_ENVS, seed=0, max_episode_steps=4)
    batch.reset()
    # As though this environment were two steps ahead.
    ahead = dataclasses.replace(batch.get_states([1])[0], steps_taken=2)
    batch.set_states([ahead], [1])
    types = []
    for actions in episodes.uniform_actions(7, batch_shape=(_NUM_ENVS,)):
        time_step = as_numpy(batch.step(actions))
        types.append([dm_env.StepType(t).name for t in time_step.step_type])
        first = time_step.step_type == dm_env.StepType.FIRST
        np.testing.assert_array_equal(time_step.observation['observation'][first, 14:], 0)
    assert [t[0] for t in types] == ['MID', 'MID', 'MID', 'LAST', 'FIRST', 'MID', 'MID']
    assert [t[1] for t in types] == ['MID', 'LAST', 'FIRST', 'MID', 'MID', 'MID', 'LAST']


def test_an_episode_ends_at_its_goal_if_it_is_to(make):
    goal = fetch_composer.load('reach', seed=0).reset().observation['achieved_goal']
    batch = make('reach', 2, seed=0, terminate_on_success=True, goal=goal)
    batch.reset(goal=[goal, goal + (0.1, 0.0, 0.0)])
    time_step = as_numpy(batch.step(_zeros(batch)))
    assert time_step.step_type.tolist() == [dm_env.StepType.LAST, dm_env.StepType.MID]
    assert time_step.discount.tolist() == [0, 1]
    assert time_step.reward.tolist() == [0, -1]


def test_rewards_are_those_of_compute_reward(make, task_name):
    for reward_type in ('sparse', 'dense'):
        batch = make(task_name, 8, seed=0, reward_type=reward_type)
        batch.reset()
        time_step = as_numpy(batch.step(_zeros(batch)))
        goals = [time_step.observation[name] for name in ('achieved_goal', 'desired_goal')]
        expected = fetch_composer.compute_reward(*goals, reward_type)
        np.testing.assert_allclose(time_step.reward, expected, atol=1e-6)


def test_every_episode_of_every_environment_has_a_fresh_start(make, task_name):
    batch = make(task_name, 50, seed=0)
    seen = [as_numpy(batch.reset()).observation for _ in range(4)]
    goals = np.concatenate([each['desired_goal'] for each in seen])
    assert len(np.unique(goals, axis=0)) == len(goals)
    if task_name != 'reach':
        places = np.concatenate([each['achieved_goal'] for each in seen])
        assert len(np.unique(places, axis=0)) == len(places)


def test_starts_and_goals_are_distributed_as_those_of_the_native_batch(make, task_name, convention):
    count = 2000
    ours = as_numpy(make(task_name, count, seed=0, convention=convention).reset()).observation
    native = fetch_composer.BatchEnvironment(task_name, count, seed=0, convention=convention)
    theirs = native.reset().observation
    for name, axis in itertools.product(('achieved_goal', 'desired_goal'), range(3)):
        # Many goals are at one height, which has other last digits in single precision.
        one, other = (each[name][:, axis].astype(float).round(5) for each in (ours, theirs))
        np.testing.assert_allclose(
            (one.min(), one.max()), (other.min(), other.max()), atol=0.01, err_msg=name
        )
        if np.ptp(other) > 1e-6:
            assert stats.ks_2samp(one, other).pvalue > 1e-4, (name, axis)


def test_a_seed_fixes_what_is_drawn_and_each_environment_draws_its_own(make):
    def goals(batch):
        return as_numpy(batch.reset().observation['desired_goal'])

    batch = make('push', 3, seed=5)
    drawn = [goals(batch) for _ in range(3)]
    single = make('push', 1, seed=6)
    for each in drawn:
        np.testing.assert_array_equal(goals(single)[0], each[1])
    batch.seed(5)
    np.testing.assert_array_equal(goals(batch), drawn[0])
    np.testing.assert_array_equal(
        as_numpy(batch.reset(seed=[7, 6, 5]).observation['desired_goal'])[[2, 1]], drawn[0][[0, 1]]
    )


def test_given_places_may_be_one_for_all_or_one_for_each(make):
    batch = make('push', 2, seed=0)
    goals = np.array([[1.2, 0.7, 0.425], [1.3, 0.8, 0.425]])
    observation = as_numpy(batch.reset(object_position=(1.25, 0.6), goal=goals)).observation
    np.testing.assert_allclose(observation['achieved_goal'][:, :2], [(1.25, 0.6)] * 2, atol=1e-6)
    np.testing.assert_allclose(observation['desired_goal'], goals, atol=1e-6)


def test_a_place_that_is_given_leaves_the_other_as_it_was(make):
    one, other = make('push', 2, seed=0), make('push', 2, seed=0)
    drawn = as_numpy(one.reset()).observation
    given = as_numpy(other.reset(goal=(1.2, 0.7, 0.425))).observation
    np.testing.assert_array_equal(drawn['achieved_goal'], given['achieved_goal'])
    for one_next, other_next in zip(
        as_numpy(one.reset()).observation.values(),
        as_numpy(other.reset()).observation.values(),
        strict=True,
    ):
        np.testing.assert_array_equal(one_next, other_next)


def test_places_of_every_episode_hold_in_every_one(make):
    batch = make('push', 2, seed=0, goal=(1.2, 0.7, 0.425), object_position=(1.25, 0.6))
    for _ in range(2):
        observation = as_numpy(batch.reset()).observation
        np.testing.assert_allclose(observation['desired_goal'], [(1.2, 0.7, 0.425)] * 2, atol=1e-6)
        np.testing.assert_allclose(
            observation['achieved_goal'][:, :2], [(1.25, 0.6)] * 2, atol=1e-6
        )


@pytest.mark.parametrize('ids', [[2, 0], np.array([True, False, True])], ids=['indices', 'mask'])
def test_those_that_are_not_reset_stay_as_they_are(make, convention, ids):
    batch = make('pick_and_place', _NUM_ENVS, seed=0, convention=convention)
    batch.reset()
    before = as_numpy(batch.step(np.ones((_NUM_ENVS, 4), np.float32)))
    after = as_numpy(batch.reset(ids))
    first, mid, _ = dm_env.StepType
    assert after.step_type.tolist() == [first, mid, first]
    assert after.reward.tolist() == [0] * _NUM_ENVS
    for name, value in after.observation.items():
        np.testing.assert_array_equal(value[1], before.observation[name][1])
    assert as_numpy(batch.steps_taken).tolist() == [0, 1, 0]


def test_time_steps_are_not_written_to_by_later_ones(make):
    batch = make('push', 2, seed=0)
    first = batch.reset()
    kept = as_numpy(first).observation
    batch.step(np.ones((2, 4), np.float32))
    for name, value in as_numpy(first).observation.items():
        np.testing.assert_array_equal(value, kept[name])


def test_jax_reads_and_writes_the_memory_of_the_device(make):
    jax = pytest.importorskip('jax', reason='JAX is not installed')
    if as_jax(wp.zeros(1, device=wp.get_device())).devices() != set(jax.devices()[:1]):
        pytest.skip('JAX has no such device')
    batch, other = make('reach', 4, seed=0), make('reach', 4, seed=0)
    observed, other_observed = as_jax(batch.reset()).observation, other.reset().observation
    np.testing.assert_array_equal(observed['observation'], as_numpy(other_observed['observation']))
    for _ in range(3):
        offset = observed['desired_goal'] - observed['achieved_goal']
        actions = jax.numpy.concatenate((10 * offset, jax.numpy.zeros((4, 1))), axis=1)
        observed = as_jax(batch.step(actions)).observation
        other_observed = as_numpy(other.step(np.array(actions))).observation
        np.testing.assert_allclose(
            observed['observation'], other_observed['observation'], rtol=0, atol=_ROUNDING
        )


def test_actions_are_clipped(make):
    one, other = make('reach', 2, seed=0), make('reach', 2, seed=0)
    one.reset(), other.reset()
    np.testing.assert_allclose(
        _observation(one.step(np.full((2, 4), 7.0))),
        _observation(other.step(np.ones((2, 4), np.float32))),
        rtol=0,
        atol=_ROUNDING,
    )


# -- States ------------------------------------------------------------------------------------


def test_what_follows_a_restored_state_is_what_followed_when_it_was_taken(
    make, task_name, convention, tmp_path
):
    batch = make(task_name, 2, seed=3, convention=convention, max_episode_steps=9)
    actions = episodes.uniform_actions(26, batch_shape=(2,))
    batch.reset()
    for each in actions[:13]:
        batch.step(each)
    states = batch.get_states()
    expected = [_observation(batch.step(each)) for each in actions[13:]]
    other = make(task_name, 2, seed=8, convention=convention, max_episode_steps=9)
    for i, state in enumerate(states):
        state.save(tmp_path / f'{i}.npz')
        other.set_states([State.load(tmp_path / f'{i}.npz')], [i])
    for each, value in zip(actions[13:], expected, strict=True):
        np.testing.assert_allclose(_observation(other.step(each)), value, rtol=0, atol=_ROUNDING)


def test_states_go_to_and_from_single_environments(make, task_name, convention):
    single = fetch_composer.load(task_name, seed=0, convention=convention)
    episodes.run(single, episodes.uniform_actions(12))
    state = single.get_state()
    batch = make(task_name, 2, seed=0, convention=convention)
    batch.reset()
    batch.set_states([state], [1])
    taken = batch.get_states([1])[0]
    np.testing.assert_allclose(taken.physics, state.physics, atol=1e-6)
    assert (taken.steps_taken, taken.is_over) == (state.steps_taken, state.is_over)
    single.set_state(dataclasses.replace(taken, generator=state.generator))
    for action in episodes.uniform_actions(5, seed=1):
        expected = single.step(action).observation['achieved_goal']
        found = as_numpy(batch.step(np.stack((action, action)))).observation['achieved_goal'][1]
        np.testing.assert_allclose(found, expected, atol=2e-4)


def test_a_state_that_does_not_fit_is_refused_and_nothing_changes(make):
    batch = make('push', 2, seed=0)
    batch.reset()
    before = _observation(batch.reset([]))
    (fitting,) = batch.get_states([0])
    of_another = make('reach', 1, seed=0)
    of_another.reset()
    broken = dataclasses.replace(
        fitting, generator={'bit_generator': 'Philox4x32', 'key': [1], 'drawn': -1}
    )
    for state, message in [
        (of_another.get_states()[0], 'task_name'),
        (broken, 'two words'),
        (dataclasses.replace(fitting, physics=np.zeros(3)), 'physics'),
    ]:
        with pytest.raises(ValueError, match=message):
            batch.set_states([fitting, state])
    np.testing.assert_array_equal(_observation(batch.reset([])), before)


# -- What goes wrong ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('actions', 'message'),
    [
        (np.zeros((2, 3)), r'shape \(2, 4\)'),
        (np.zeros((3, 4)), r'shape \(2, 4\)'),
        ([['a'] * 4] * 2, 'numbers'),
        (wp.zeros((2, 4), dtype=wp.float64, device='cpu'), 'float32'),
    ],
)
def test_actions_of_another_kind_are_refused(make, actions, message):
    batch = make('push', 2, seed=0)
    batch.reset()
    with pytest.raises(ValueError, match=message):
        batch.step(actions)
    assert as_numpy(batch.steps_taken).tolist() == [0, 0]


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_actions_that_are_not_finite_are_reported_and_taken_as_zeros(make, value):
    batch, other = make('push', 3, seed=0), make('push', 3, seed=0)
    batch.reset(), other.reset()
    actions = np.zeros((3, 4), np.float32)
    actions[1, 2] = value
    with pytest.raises(ValueError, match=r'rows \[1\]'):
        batch.step(actions)
        batch.check()
    other.step(_zeros(other))
    batch.check()
    np.testing.assert_allclose(
        _observation(batch.step(_zeros(batch))),
        _observation(other.step(_zeros(other))),
        rtol=0,
        atol=_ROUNDING,
    )


def test_an_environment_that_diverges_is_reported_and_starts_anew_alone(make):
    batch, other = make('push', 3, seed=0), make('push', 3, seed=0)
    batch.reset(), other.reset()
    (state,) = batch.get_states([1])
    physics = state.physics.copy()
    physics[1 + 14 + 5] = 1e8  # rad/s of a joint of the arm.
    batch.set_states([dataclasses.replace(state, physics=physics)], [1])
    with pytest.raises(control.PhysicsError, match=r'\[1\]'):
        for _ in range(5):
            batch.step(_zeros(batch))
            batch.check()
    steps = int(as_numpy(batch.steps_taken)[0])
    for _ in range(steps):
        other.step(_zeros(other))
    time_step, expected = as_numpy(batch.step(_zeros(batch))), as_numpy(other.step(_zeros(other)))
    first, mid, _ = dm_env.StepType
    assert time_step.step_type.tolist() == [mid, first, mid]
    observation = time_step.observation['observation']
    assert np.isfinite(observation).all()
    np.testing.assert_allclose(
        observation[[0, 2]], expected.observation['observation'][[0, 2]], atol=1e-6
    )


@pytest.mark.parametrize('name', ['nconmax', 'njmax'])
def test_too_little_room_is_an_error_that_names_what_to_raise(make, name):
    batch = make('push', 2, seed=0, **{name: 1})
    batch.reset()
    with pytest.raises(RuntimeError, match=rf'{name} \(1\) was too small .* {name}=2'):
        batch.step(_zeros(batch))
        batch.check()


def test_there_is_room_for_what_random_actions_need(make, task_name, convention):
    batch = make(task_name, 20, seed=0, convention=convention)
    batch.reset()
    for actions in episodes.uniform_actions(50, batch_shape=(20,)):
        actions[::2, 2] -= 0.6
        actions[::2, 3] -= 0.5
        batch.step(actions)
    batch.check()


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'task': 'walk'}, 'valid are'),
        ({'task': 'push_two'}, 'push_two'),
        ({'task': 'push_around'}, 'push_around'),
        ({'num_envs': 0}, 'num_envs'),
        ({'device': 'tpu'}, 'Unknown device .* valid are'),
        ({'seed': -1}, 'seed'),
        ({'njmax': 0}, 'njmax'),
        ({'convert': 'torch'}, 'convert'),
        ({'observation_mode': 'pixels'}, 'observation_mode'),
        ({'action_mode': 'joints'}, 'action_mode'),
        ({'variations': {'friction': 0.5}}, 'variations'),
        ({'goal': (9.0, 9.0, 9.0)}, 'off the table'),
    ],
)
def test_what_it_has_not_is_refused(device, options, message):
    from fetch_composer.warp_batch import WarpBatchEnvironment

    with pytest.raises(ValueError, match=message):
        WarpBatchEnvironment(**{'task': 'push', 'num_envs': 2, 'device': device, **options})


def test_bad_resets_are_refused_and_nothing_changes(make):
    batch = make('push', 2, seed=0)
    batch.reset()
    before = _observation(batch.step(_zeros(batch)))
    for arguments, message in [
        ({'ids': [2]}, 'ids'),
        ({'goal': (9.0, 9.0, 9.0)}, 'off the table'),
        ({'object_position': (1.0, np.nan)}, 'object_position'),
        ({'seed': 'a'}, 'seed'),
    ]:
        with pytest.raises(ValueError, match=message):
            batch.reset(**arguments)
    np.testing.assert_array_equal(_observation(batch.reset([])), before)


def test_a_closed_batch_says_so(make):
    batch = make('reach', 1, seed=0)
    batch.close()
    batch.close()
    for use in (batch.reset, batch.check, batch.get_states, lambda: batch.step(np.zeros((1, 4)))):
        with pytest.raises(RuntimeError, match='closed'):
            use()


def test_it_has_every_published_task():
    assert set(tasks.published()) == {'pick_and_place', 'push', 'reach', 'slide'}
