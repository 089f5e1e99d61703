"""The native control step against Composer's own loop, and Composer's features on top."""

import numpy as np
import pytest
from dm_control import composer
from dm_control.composer.observation import observable
from dm_control.composer.variation import noises
from dm_control.rl import control

import fetch_composer
from fetch_composer import tasks
from tests import episodes


def _nothing(*unused_args):
    pass


def _count_substeps(env) -> list:
    calls = []
    env.add_extra_hook('after_substep', lambda *unused_args: calls.append(1))
    return calls


def test_native_and_stock_loop_are_equal_to_the_bit(task_name, convention):
    native = fetch_composer.load(task_name, seed=3, convention=convention)
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
    fast = fetch_composer.load(task_name, seed=0)
    slow = fetch_composer.load(
        task_name, seed=0, environment_kwargs={'recompile_mjcf_every_episode': True}
    )
    episodes.assert_same(episodes.run(fast, actions), episodes.run(slow, actions))


def test_reset_does_not_recompile(env):
    env.reset()
    model = env.physics.model.ptr
    env.reset()
    assert env.physics.model.ptr is model
    assert isinstance(env, composer.Environment)
