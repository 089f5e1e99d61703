"""Props: bodies without a goal, whose places are drawn."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from dm_control.composer.variation import deterministic

import fetch_composer
from fetch_composer import entities
from fetch_composer.environment import Environment
from fetch_composer.tasks import Push, TaskOptions
from tests import episodes, pages

_ROOT = pathlib.Path(__file__).parents[1]
_PAGE = 'new_task.md'
_TASK = 'push_past_clutter'
_RADIUS = 0.025  # m, of the documented clutter.


@pytest.fixture(scope='module', autouse=True)
def documented_task():
    exec(compile(pages.code_of(_PAGE, 2), _PAGE, 'exec'), {'__name__': 'documents'})


def _props(env):
    joints = [each.joint for each in env.task.scene.props]
    return np.array([env.physics.bind(joint).qpos[:3] for joint in joints])


def test_places_are_drawn_clear_of_objects_goals_and_one_another():
    env = fetch_composer.load(_TASK, seed=0)
    found = []
    for _ in range(100):
        observation = env.reset().observation
        props = _props(env)
        np.testing.assert_allclose(props[:, 2], 0.425, atol=1e-9)
        others = [observation['achieved_goal'], observation['desired_goal']]
        for i, prop in enumerate(props):
            for other in others:
                radius = 0.025 * np.sqrt(2)  # Of the block, from above.
                assert np.linalg.norm((prop - other)[:2]) >= radius + _RADIUS
            for other in props[:i]:
                assert np.linalg.norm((prop - other)[:2]) >= 2 * _RADIUS
        found.append(props)
    assert np.std(found, axis=0)[:, :2].min() > 0.05


def test_objects_and_goals_are_those_of_the_seed_without_props():
    env, plain = (fetch_composer.load(name, seed=4) for name in (_TASK, 'push'))
    one, other = env.reset().observation, plain.reset().observation
    for name in ('achieved_goal', 'desired_goal'):
        np.testing.assert_allclose(one[name], other[name], atol=2e-4)
    assert one['observation'].shape == (25,)


def test_a_prop_keeps_clear_of_an_object_whose_place_is_given():
    env = fetch_composer.load(_TASK, seed=0, object_position=(1.3, 0.7), goal=(1.4, 0.8, 0.425))
    for _ in range(50):
        env.reset()
        assert np.linalg.norm(_props(env)[:, :2] - (1.3, 0.7), axis=1).min() > 0.06


def test_a_policy_can_push_it_and_the_next_episode_draws_it_again():
    env = fetch_composer.load(_TASK, seed=0)
    time_step = env.reset()
    before = _props(env)
    while not time_step.last():  # Down beside it, and through it.
        gripper = time_step.observation['observation'][:3]
        way = before[0] + (0.0, 0.06, 0.0) - gripper
        if gripper[2] < 0.43:
            action = (0.0, -1.0, 0.0, 0.0)
        else:
            sinks = np.abs(way[:2]).max() < 0.02
            action = (*np.clip(20 * way[:2], -1, 1), -1.0 if sinks else 0.0, 0.0)
        time_step = env.step(np.array(action, np.float32))
    after = _props(env)
    assert np.linalg.norm((after - before)[0]) > 0.03
    env.reset()
    assert np.linalg.norm((_props(env) - after)[0]) > 0.01


@pytest.mark.parametrize('rows', [1, 3])
def test_rows_of_a_batch_are_single_environments(rows):
    batch = fetch_composer.BatchEnvironment(_TASK, rows, seed=5)
    singles = [fetch_composer.load(_TASK, seed=5 + i) for i in range(rows)]
    batched, expected = batch.reset(), [single.reset() for single in singles]
    for _ in range(110):
        for i, each in enumerate(expected):
            for name, value in each.observation.items():
                np.testing.assert_allclose(batched.observation[name][i], value, rtol=0, atol=1e-9)
        for state, single in zip(batch.get_states(), singles, strict=True):
            np.testing.assert_array_equal(state.prop_position, single.get_state().prop_position)
        actions = np.array([episodes.push_through(each.observation) for each in expected])
        batched = batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]


_RESTORE = """
import json, sys
import numpy as np
import fetch_composer
from fetch_composer.tasks.state import State
from tests import pages

exec(compile(pages.code_of('new_task.md', 2), 'page', 'exec'), {'__name__': 'documents'})
env = fetch_composer.load('push_past_clutter', seed=99)
env.set_state(State.load(sys.argv[1]))
found = []
for _ in range(60):
    env.step(np.full(4, 0.3))
    found.append(env.get_state().physics.tolist())
print(json.dumps([found, env.get_state().prop_position.tolist()]))
"""


def test_a_state_carries_props_to_another_process(tmp_path):
    env = fetch_composer.load(_TASK, seed=0)
    env.reset()
    env.step(np.full(4, 0.3))
    env.get_state().save(tmp_path / 'state.npz')
    expected = []
    for _ in range(60):  # Into the next episode.
        env.step(np.full(4, 0.3))
        expected.append(env.get_state().physics)
    run = subprocess.run(
        [sys.executable, '-c', _RESTORE, str(tmp_path / 'state.npz')],
        env={**os.environ, 'MUJOCO_GL': 'disabled', 'PYTHONPATH': str(_ROOT)},
        capture_output=True,
        check=True,
    )
    physics, places = json.loads(run.stdout)
    np.testing.assert_array_equal(physics, expected)
    np.testing.assert_array_equal(places, env.get_state().prop_position)


def test_a_state_goes_to_a_batch_and_back_and_one_without_props_is_refused():
    env = fetch_composer.load(_TASK, seed=0)
    env.set_state(env.get_state())  # Of no episode yet.
    env.reset()
    batch = fetch_composer.BatchEnvironment(_TASK, 2, seed=7)
    batch.set_states([env.get_state()] * 2)
    rows = [batch.step(np.full((2, 4), 0.3)) for _ in range(5)][-1].observation['observation']
    single = [env.step(np.full(4, 0.3)) for _ in range(5)][-1].observation['observation']
    np.testing.assert_allclose(rows, [single] * 2, atol=1e-9)
    env.set_state(batch.get_states([1])[0])
    plain = fetch_composer.load('push', seed=0)
    plain.reset()
    with pytest.raises(ValueError, match='of another environment'):
        env.set_state(plain.get_state())


def test_pictures_of_the_goal_show_the_props_where_they_start():
    options = {
        'observation_mode': 'pixels',
        'pixels': {'cameras': 'close', 'height': 45, 'width': 60, 'goal': True},
    }
    batch = fetch_composer.BatchEnvironment(_TASK, 2, seed=2, **options)
    pictures = batch.reset().observation
    single = fetch_composer.load(_TASK, seed=3, **options).reset().observation
    plain = fetch_composer.load('push', seed=3, **options).reset().observation
    for name in ('close_rgb', 'close_goal_rgb'):
        np.testing.assert_array_equal(pictures[name][1], single[name])
        change = np.abs(single[name].astype(int) - plain[name]).max(axis=-1)
        assert (change > 30).sum() > 10


class _PushWithProp(Push):
    def __init__(self, sampler, **looks):
        super().__init__(TaskOptions())
        self.scene.add_prop(entities.Block(name='post', **looks), sampler)


def test_a_slippery_prop_slides_no_further_on_a_rough_table():
    """A contact has the larger friction of its two geoms, as the page says."""
    ways = []
    for friction in (0.2, 1.0, 2.0):
        place = deterministic.Constant((1.15, 0.5))
        task = _PushWithProp(
            place, geom_type='cylinder', size=(0.04, 0.01), friction=(friction, 0.005, 0.0001)
        )
        env = Environment(task, random_state=0)
        env.reset()
        joint = env.physics.bind(task.scene.props[0].joint)
        joint.qvel[1] = 1.0  # m/s
        for _ in range(10):
            env.step(np.zeros(4, np.float32))
        ways.append(float(joint.qpos[1]) - 0.5)
    slippery, like_the_table, rough = ways
    assert slippery == like_the_table > rough + 0.005


@pytest.mark.parametrize(
    ('place', 'message'),
    [
        ((0.0, 0.0), "No place for the prop 'post' that is clear of all else"),  # Off the table.
        ((1.3, 0.75, 0.4), r'The place of a prop must be finite numbers of shape \(2,\)'),
        ((np.nan, 0.75), 'The place of a prop must be finite numbers'),
    ],
)
def test_places_that_cannot_be_are_refused(place, message):
    env = Environment(_PushWithProp(deterministic.Constant(place)), random_state=0)
    with pytest.raises(ValueError, match=message):
        env.reset()
