"""The native control step against Composer's own loop, and Composer's features on top."""

import copy
import pickle

import numpy as np
import pytest
from dm_control import composer
from dm_control.composer.observation import observable
from dm_control.composer.variation import noises
from dm_control.rl import control
from dm_control.suite.wrappers import action_noise

import fetch_composer
from fetch_composer import policies, suite, tasks
from tests import episodes


def _nothing(*unused_args):
    pass


def _count_substeps(env) -> list:
    calls = []
    env.add_extra_hook('after_substep', lambda *unused_args: calls.append(1))
    return calls


def test_native_and_stock_loop_are_equal_to_the_bit(task_name, convention):
    native = episodes.shared(task_name, 3, convention=convention)
    stock = fetch_composer.load(task_name, seed=3, convention=convention)
    stock.add_extra_hook('before_substep', _nothing)
    actions = episodes.uniform_actions(110, seed=1)
    episodes.assert_same(episodes.run(native, actions), episodes.run(stock, actions))


def test_an_extra_substep_hook_runs_at_every_substep(task_name):
    env = fetch_composer.load(task_name, seed=0)
    calls = _count_substeps(env)
    episodes.run(env, episodes.uniform_actions(3))
    assert len(calls) == 60


def test_a_hook_added_within_an_episode_runs_from_then_on():
    env = fetch_composer.load('push', seed=0)
    episodes.run(env, episodes.uniform_actions(2))
    calls = _count_substeps(env)
    env.step(np.zeros(4, np.float32))
    assert len(calls) == 20


def test_step_hooks_run_once_a_control_step():
    env = fetch_composer.load('push', seed=0)
    calls = []
    env.add_extra_hook('before_step', lambda *unused_args: calls.append('before'))
    env.add_extra_hook('after_step', lambda *unused_args: calls.append('after'))
    episodes.run(env, episodes.uniform_actions(3))
    assert calls == ['before', 'after'] * 3


def test_a_tasks_own_substep_hook_runs():
    class Counting(tasks.Push):
        substeps = 0

        def after_substep(self, physics, random_state):
            self.substeps += 1

    env = fetch_composer.Environment(Counting(), random_state=0)
    episodes.run(env, episodes.uniform_actions(2))
    assert env.task.substeps == 40


def test_noise_is_applied_alike_on_both_paths():
    def noisy(stock: bool):
        env = fetch_composer.load('push', seed=2)
        env.task.observables['achieved_goal'].corruptor = noises.Additive(
            lambda initial_value=None, current_value=None, random_state=None: random_state.normal(
                scale=0.01, size=3
            )
        )
        if stock:
            env.add_extra_hook('before_substep', _nothing)
        return episodes.run(env, episodes.uniform_actions(20))

    native = noisy(stock=False)
    episodes.assert_same(native, noisy(stock=True))
    first = native[5].observation
    assert np.abs(first['achieved_goal'] - first['observation'][3:6]).max() > 1e-4


def test_buffers_delays_and_intervals_work():
    env = fetch_composer.load('push', seed=0)
    joints = env.task.observables['fetch/joints_pos']
    joints.enabled, joints.buffer_size = True, 5
    late = env.task.observables['fetch/gripper/tool_center_point']
    late.enabled, late.delay, late.update_interval = True, 20, 20
    calls = env.task.observables['fetch/joints_vel']
    calls.enabled, calls.buffer_size, calls.aggregator = True, 4, 'mean'
    time_steps = episodes.run(env, episodes.uniform_actions(6))
    last, previous = time_steps[-1].observation, time_steps[-2].observation
    assert last['fetch/joints_pos'].shape == (5, 7)
    assert np.ptp(last['fetch/joints_pos'], axis=0).max() > 1e-6
    assert last['fetch/joints_vel'].shape == (7,)
    # A delay of one control step shows where the gripper was, up to the substep in progress.
    delayed, here = last['fetch/gripper/tool_center_point'], last['observation'][:3]
    before = previous['observation'][:3]
    assert np.abs(delayed - before).max() < 0.2 * np.abs(here - before).max()


def test_an_additional_task_observable_is_observed():
    class Timed(tasks.Push):
        @property
        def task_observables(self):
            observables = super().task_observables
            if 'time' not in observables:
                observables['time'] = observable.Generic(lambda physics: physics.time())
                observables['time'].enabled = True
            return observables

    env = fetch_composer.Environment(Timed(), random_state=0)
    times = [float(t.observation['time']) for t in episodes.run(env, np.zeros((3, 4)))]
    np.testing.assert_allclose(times, [0, 0.04, 0.08, 0.12], atol=1e-9)


def test_a_time_limit_of_composer_is_kept():
    env = fetch_composer.load('push', seed=0, environment_kwargs={'time_limit': 0.395})
    time_steps = episodes.run(env, episodes.uniform_actions(10))
    assert [t.last() for t in time_steps].index(True) == 10


def test_divergence_raises_or_ends_the_episode():
    def blow_up(env):
        env.reset()
        env.physics.data.qvel[:] = 1e12
        return env.step(np.zeros(4, np.float32))

    with pytest.raises(control.PhysicsError):
        blow_up(fetch_composer.load('push', seed=0))
    forgiving = fetch_composer.load(
        'push', seed=0, environment_kwargs={'raise_exception_on_physics_error': False}
    )
    time_step = blow_up(forgiving)
    assert time_step.last()
    assert time_step.discount == 0
    assert forgiving.step(np.zeros(4, np.float32)).first()


def test_stepping_first_resets():
    env = fetch_composer.load('push', seed=0)
    assert env.step(np.zeros(4, np.float32)).first()


def test_recompiling_every_episode_gives_the_same_episodes(task_name):
    actions = episodes.uniform_actions(60)
    fast = episodes.shared(task_name)
    slow = fetch_composer.load(
        task_name, seed=0, environment_kwargs={'recompile_mjcf_every_episode': True}
    )
    episodes.assert_same(episodes.run(fast, actions), episodes.run(slow, actions))


def test_reset_does_not_recompile(shared_env):
    shared_env.reset()
    model = shared_env.physics.model.ptr
    shared_env.reset()
    assert shared_env.physics.model.ptr is model


def test_dm_controls_action_noise_wraps_it():
    env = action_noise.Wrapper(fetch_composer.load('push', seed=0), scale=0.5)
    noisy = episodes.run(env, np.zeros((5, 4), np.float32))
    still = episodes.run(fetch_composer.load('push', seed=0), np.zeros((5, 4), np.float32))
    moved = noisy[-1].observation['achieved_goal'] - still[-1].observation['achieved_goal']
    gripper = noisy[-1].observation['observation'][:3] - still[-1].observation['observation'][:3]
    assert np.abs(moved).max() < 1e-6 < np.abs(gripper).max()


def test_flat_observations_are_the_dictionarys_in_its_order(task_name):
    plain = episodes.shared(task_name)
    flat = suite.load('fetch', task_name, {'random': 0}, {'flat_observation': True})
    stock = suite.load('fetch', task_name, {'random': 0}, {'flat_observation': True})
    stock.add_extra_hook('before_substep', _nothing)
    (spec,) = flat.observation_spec().values()
    actions = episodes.uniform_actions(55)
    expected = [np.concatenate([*t.observation.values()]) for t in episodes.run(plain, actions)]
    for env in flat, stock:
        for time_step, vector in zip(episodes.run(env, actions), expected, strict=True):
            assert list(time_step.observation) == ['observations']
            spec.validate(time_step.observation['observations'])
            np.testing.assert_array_equal(time_step.observation['observations'], vector)


def test_a_control_timestep_changes_how_long_a_step_is():
    env = suite.load('fetch', 'push', {'random': 0}, {'control_timestep': 0.02})
    assert env.control_timestep() == 0.02
    time_steps = episodes.run(env, np.tile(np.float32([1, 0, 0, 0]), (4, 1)))
    assert env.physics.time() == pytest.approx(0.08)
    before, after = (t.observation['observation'] for t in time_steps[2:4])
    # Velocities are still displacements per control step.
    assert after[20] == pytest.approx(after[0] - before[0], rel=0.3)
    with pytest.raises(ValueError, match='0.0015'):
        suite.load('fetch', 'push', environment_kwargs={'control_timestep': 0.0015})
    for value in (0, -0.04, True, np.nan, np.inf, 'slow', [0.04]):
        with pytest.raises(ValueError, match='control_timestep must be a positive number'):
            suite.load('fetch', 'push', environment_kwargs={'control_timestep': value})


def test_a_seed_among_the_environments_options_is_taken_and_two_are_refused():
    one = fetch_composer.load('push', environment_kwargs={'random_state': 3})
    episodes.assert_same([one.reset()], [fetch_composer.load('push', seed=3).reset()])
    with pytest.raises(ValueError, match='seed is given twice'):
        fetch_composer.load('push', seed=3, environment_kwargs={'random_state': 3})
    with pytest.raises(ValueError, match='seed is given twice'):
        fetch_composer.load('push', seed=3, random=3)


def test_a_seed_is_kept_where_every_episode_starts_alike():
    kwargs = {'fixed_initial_state': True}
    env = fetch_composer.load('push', seed=0, environment_kwargs=kwargs)
    first = env.reset()
    episodes.assert_same([env.reset()], [first])
    env.seed(5)
    expected = fetch_composer.load('push', seed=5).reset()
    for _ in range(2):
        episodes.assert_same([env.reset()], [expected])


def test_a_state_set_from_outside_goes_on_as_it_was(task_name, convention):
    """Such as dm_control's own planners do: a reset forgets where the mocap body pointed."""
    actions = episodes.uniform_actions(30, seed=3)
    kept, other = (episodes.shared(task_name, 2, i, convention=convention) for i in range(2))
    for env in kept, other:
        episodes.run(env, actions[:20])
    state = other.physics.get_state()
    with other.physics.reset_context():
        other.physics.set_state(state)
    for action in actions[20:]:
        one, another = kept.step(action), other.step(action)
    np.testing.assert_allclose(
        one.observation['observation'][:3], another.observation['observation'][:3], atol=2e-3
    )


def test_after_close_every_call_says_that_it_is_closed():
    env = fetch_composer.load('push', seed=0)
    env.reset()
    env.close()
    env.close()
    calls = (
        env.reset,
        lambda: env.step(np.zeros(4, np.float32)),
        lambda: env.seed(0),
        lambda: env.physics,
    )
    for call in calls:
        with pytest.raises(RuntimeError, match='closed'):
            call()


@pytest.mark.parametrize('copy_of', [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_copy_is_refused_with_what_to_do_instead(copy_of):
    batch = fetch_composer.BatchEnvironment('push', 2)
    for env, instead in ((fetch_composer.load('push'), 'load another'), (batch, 'make another')):
        with pytest.raises(TypeError, match=instead):
            copy_of(env)


def test_a_failed_start_leaves_nothing_to_step():
    env = fetch_composer.load('push', seed=0, max_episode_steps=None)
    episodes.run(env, episodes.uniform_actions(3))
    fails = [True]

    def fail(physics, random_state):
        if fails[0]:
            raise composer.EpisodeInitializationError('no place')

    env.add_extra_hook('initialize_episode', fail)
    for call in env.reset, lambda: env.step(np.zeros(4, np.float32)):
        with pytest.raises(composer.EpisodeInitializationError):
            call()
    fails[0] = False
    assert env.step(np.zeros(4, np.float32)).first()


def test_what_is_changed_before_the_first_episode_is_there():
    env = fetch_composer.load('push', seed=0)
    env.task.scene.table.geom.rgba = (0.1, 0.2, 0.3, 1)
    env.task.root_entity.mjcf_model.worldbody.add('geom', name='ball', size=(0.1,), pos=(0, 0, 3))
    env.task.observables['fetch/joints_pos'].enabled = True
    assert 'fetch/joints_pos' in env.reset().observation
    np.testing.assert_allclose(
        env.physics.named.model.geom_rgba['table/table'], (0.1, 0.2, 0.3, 1), atol=1e-6
    )
    assert env.physics.model.name2id('ball', 'geom') >= 0


def test_a_hook_may_change_the_model_before_the_first_episode():
    env = fetch_composer.load('push', seed=0)

    def widen(random_state):
        env.task.scene.table.geom.size = (0.3, 0.4, 0.2)

    env.add_extra_hook('initialize_episode_mjcf', widen)
    env.reset()
    np.testing.assert_array_equal(env.physics.named.model.geom_size['table/table'], (0.3, 0.4, 0.2))


def test_a_place_that_a_variation_is_in_the_way_of_is_for_one_episode_alone():
    env = fetch_composer.load('push', seed=0, variations={'gripper_offset': (0, 0, -0.1)})
    env.task.set_next_episode(object_position=(1.3419, 0.7491))
    with pytest.raises(ValueError, match='is where the gripper starts'):
        env.reset()
    assert env.reset().first()


def test_a_restored_target_has_the_colour_of_what_it_is():
    env = fetch_composer.load('reach', seed=0)
    env.task.visualize_reward = True
    expert = policies.load('expert', env)
    time_step = env.reset()
    states, colours = [], []
    while not time_step.last():
        states.append(env.get_state())
        colours.append(env.physics.bind(env.task.scene.targets[0].site).rgba.copy())
        time_step = env.step(expert(time_step.observation))
    assert not np.array_equal(colours[0], colours[-1])
    for state, colour in zip(reversed(states), reversed(colours), strict=True):
        env.set_state(state)
        np.testing.assert_array_equal(env.physics.bind(env.task.scene.targets[0].site).rgba, colour)
