"""Objects whose shape is drawn for each episode."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import fetch_composer
from fetch_composer import entities, tasks
from fetch_composer.entities import shapes
from fetch_composer.environment import Environment
from fetch_composer.tasks import samplers, tabletop
from tests import episodes, object_shapes

_ROOT = pathlib.Path(__file__).parents[1]
_TABLE_TOP = 0.4


class _AlignedBlock(tasks.GoalTask):
    """Push, of a block whose frame starts upright."""

    def __init__(self, block=None, **options):
        block = block or entities.Block()
        super().__init__(tasks.TaskOptions(**options), tabletop.WORKSPACE, (block,))

    def _build_samplers(self):
        return (
            samplers.OffsetBeyond(self.grip_start, 0.15, 0.1),
            samplers.GoalAround(self.grip_start, 0.15, self.object_height),
        )


# Sizes other than the default; an ellipsoid lies on another side.
_SIZES = {
    'box': (0.03, 0.02, 0.015),
    'cylinder': (0.03, 0.015),
    'capsule': (0.02, 0.035),
    'ellipsoid': (0.02, 0.025, 0.03),
}
_COMPILED = (
    'geom_type', 'geom_dataid', 'geom_size', 'geom_pos', 'geom_quat', 'geom_rbound', 'geom_aabb',
    'body_mass', 'body_inertia', 'body_ipos', 'body_iquat', 'body_subtreemass', 'body_invweight0',
    'dof_invweight0', 'dof_M0',
)  # fmt: skip


def _assert_compiled_alike(env, other):
    varied, compiled = env.physics.model.ptr, other.physics.model.ptr
    for field in _COMPILED:
        np.testing.assert_allclose(
            getattr(varied, field), getattr(compiled, field), rtol=1e-6, atol=1e-9, err_msg=field
        )
    bodies = compiled.body_bvhnum.sum()
    np.testing.assert_allclose(
        varied.bvh_aabb[:bodies], compiled.bvh_aabb[:bodies], rtol=1e-6, atol=1e-9
    )


def test_a_drawn_shape_is_the_object_compiled_that_way(shape, mesh):
    env = fetch_composer.load(
        'push',
        seed=0,
        variations={'object_shape': shape},
        object_mesh=mesh,
        convention='documented',
    )
    other = fetch_composer.load('push', seed=0, **object_shapes.chosen(shape, mesh))
    varied, compiled = env.reset().observation, other.reset().observation
    _assert_compiled_alike(env, other)
    np.testing.assert_allclose(varied['observation'], compiled['observation'], atol=1e-12)
    np.testing.assert_allclose(varied['desired_goal'], compiled['desired_goal'], atol=1e-12)


@pytest.mark.parametrize('shape', _SIZES)
@pytest.mark.parametrize('chosen', [True, False])
def test_a_drawn_size_is_the_object_compiled_that_way(shape, chosen):
    sizes = {'object_size': _SIZES[shape], 'object_mass': 1.3}
    shapes_given = {'object_shape': shape} if chosen else {}
    varying = {} if chosen else {'object_shape': shape}
    env = fetch_composer.load('push', seed=0, variations={**varying, **sizes}, **shapes_given)
    other = fetch_composer.load(
        'push', seed=0, object_shape=shape, object_size=_SIZES[shape],
        variations={'object_mass': 1.3},
    )  # fmt: skip
    varied, compiled = env.reset().observation, other.reset().observation
    _assert_compiled_alike(env, other)
    np.testing.assert_allclose(varied['achieved_goal'], compiled['achieved_goal'], atol=1e-12)


def test_an_object_aligned_with_its_body_takes_any_shape_too(shape, mesh):
    """MuJoCo's shortcuts for aligned bodies do not outlast the shape that they hold for."""
    drawn = {'variations': {'object_shape': shape}, 'object_mesh': mesh}
    pair = [
        Environment(_AlignedBlock(**each), random_state=0)
        for each in (drawn, object_shapes.chosen(shape, mesh))
    ]
    after = []
    for env in pair:
        env.reset()
        joint = env.physics.bind(env.task.scene.object_joints[0])
        joint.qpos[2] += 0.2
        joint.qvel = (0.1, 0.0, 0.2, 3.0, 4.0, 5.0)  # It tumbles in the air.
        for _ in range(4):
            time_step = env.step(np.zeros(4, np.float32))
        after.append(time_step.observation['observation'])
    np.testing.assert_allclose(*after, atol=1e-6)


def test_a_mesh_of_a_task_of_ones_own_is_drawn_from_the_file_that_is_chosen(mesh, tmp_path):
    own = object_shapes.write_obj(tmp_path / 'own.obj', object_shapes.VERTICES * (1, 2, 3))
    plain = Environment(_AlignedBlock(entities.Block(mesh=own, size=(0.03,))), random_state=0)
    half_height = plain.reset().observation['achieved_goal'][2] - _TABLE_TOP
    assert half_height == pytest.approx(0.03 * 6 / 8)
    for other in (mesh, own):
        task = _AlignedBlock(
            entities.Block(mesh=own), object_mesh=other, variations={'object_shape': 'mesh'}
        )
        drawn = Environment(task, random_state=0).reset().observation['achieved_goal']
        usual = entities.Block(mesh=other).half_height
        assert drawn[2] - _TABLE_TOP == pytest.approx(usual)


def test_a_seed_fixes_the_shapes_and_every_one_is_drawn(mesh):
    one, other = (
        fetch_composer.load('push', seed=3, **object_shapes.drawn(mesh)) for _ in range(2)
    )
    found = []
    for _ in range(30):
        episodes.assert_same([one.reset()], [other.reset()])
        assert object_shapes.geom_type(one) == object_shapes.geom_type(other)
        found.append(object_shapes.geom_type(one))
    assert set(found) == set(shapes.NAMES)


@pytest.mark.parametrize('name', ['push', 'pick_and_place', 'push_two'])
@pytest.mark.parametrize('rows', [1, 3])
def test_rows_of_a_batch_are_single_environments_of_the_same_shapes(name, rows, mesh):
    options = {**object_shapes.drawn(mesh), 'max_episode_steps': 15}
    batch = fetch_composer.BatchEnvironment(name, rows, seed=1, **options)
    singles = [fetch_composer.load(name, seed=1 + i, **options) for i in range(rows)]
    batched, expected = batch.reset(), [single.reset() for single in singles]
    seen = set()
    for _ in range(70):
        seen.update(object_shapes.geom_type(each) for each in singles)
        for i, each in enumerate(expected):
            for key, value in each.observation.items():
                np.testing.assert_allclose(batched.observation[key][i], value, rtol=0, atol=1e-9)
        actions = np.array([episodes.push_through(_of_first(e.observation)) for e in expected])
        batched = batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]
    assert len(seen) > 1


def _of_first(observation):
    return {name: value[:25] if name == 'observation' else value[:3]
            for name, value in observation.items()}  # fmt: skip


_RESTORE = """
import json, sys
import numpy as np
import fetch_composer
from dm_control.composer.variation import distributions
from fetch_composer.entities import shapes
from fetch_composer.tasks.state import State

variations = {'object_shape': distributions.UniformChoice(shapes.NAMES)}
env = fetch_composer.load('push', seed=99, variations=variations, object_mesh=sys.argv[2])
env.set_state(State.load(sys.argv[1]))
found = [env.step(np.full(4, 0.3)).observation['observation'].tolist() for _ in range(60)]
print(json.dumps(found))
"""


def test_a_state_carries_the_shape_to_another_process(mesh, tmp_path):
    env = fetch_composer.load('push', seed=0, **object_shapes.drawn(mesh))
    while env.reset() and object_shapes.geom_type(env) in ('box', 'cylinder'):
        pass
    env.step(np.full(4, 0.3))
    env.get_state().save(tmp_path / 'state.npz')
    expected = [env.step(np.full(4, 0.3)).observation['observation'] for _ in range(60)]
    run = subprocess.run(
        [sys.executable, '-c', _RESTORE, str(tmp_path / 'state.npz'), mesh],
        env={**os.environ, 'MUJOCO_GL': 'disabled', 'PYTHONPATH': str(_ROOT)},
        capture_output=True,
        check=True,
    )
    np.testing.assert_array_equal(json.loads(run.stdout), expected)


def test_states_go_from_a_single_environment_to_rows_of_a_batch(mesh):
    env = fetch_composer.load('push', seed=0, **object_shapes.drawn(mesh))
    batch = fetch_composer.BatchEnvironment('push', 2, seed=7, **object_shapes.drawn(mesh))
    for _ in range(4):
        env.reset()
        batch.set_states([env.get_state()] * 2)
        single = [env.step(np.full(4, 0.3)) for _ in range(5)][-1]
        rows = [batch.step(np.full((2, 4), 0.3)) for _ in range(5)][-1]
        for row in rows.observation['observation']:
            np.testing.assert_allclose(row, single.observation['observation'], atol=1e-9)


def test_objects_keep_clear_of_one_another_whatever_their_size(mesh):
    env = fetch_composer.load('push_two', seed=0, object_shape='capsule', object_size=(0.03, 0.05))
    env_around = fetch_composer.load(
        'push_around', seed=0, object_shape='cylinder', object_size=(0.08, 0.02)
    )
    for _ in range(40):
        first, second = env.reset().observation['achieved_goal'].reshape(2, 3)
        assert np.linalg.norm((first - second)[:2]) >= 2 * (0.03 + 0.05)
        beside = abs(env_around.reset().observation['achieved_goal'][1] - 0.7491)
        assert beside > 0.08 + 0.015 - 1e-9
    with pytest.raises(ValueError, match='two objects meet: they must be at least 0.160 m apart'):
        env.task.set_next_episode(object_position=(1.2, 0.7, 1.2, 0.84))


@pytest.mark.parametrize(
    ('variations', 'message'),
    [
        ({'object_shape': 'ball'}, 'valid are box, cylinder'),
        ({'object_shape': ('box', 'capsule')}, 'give distributions.UniformChoice'),
        ({'object_shape': 'mesh'}, 'choose one with the option object_mesh'),
        ({'object_shape': 'capsule', 'object_size': (0.02, 0.02, 0.02)}, 'has 2 sizes'),
    ],
)
def test_drawn_shapes_that_cannot_be_are_refused(variations, message):
    env = fetch_composer.load('push', seed=0, variations=variations)
    with pytest.raises(ValueError, match=message):
        env.reset()


def test_pictures_show_the_drawn_shape_and_its_goal(mesh):
    options = {
        'observation_mode': 'pixels',
        'pixels': {'cameras': 'close', 'height': 45, 'width': 60, 'goal': True},
    }
    place = {'object_position': (1.3, 0.9), 'goal': (1.4, 0.8, 0.425)}
    pictures = {}
    for shape in ('capsule', 'mesh'):
        drawn = fetch_composer.load(
            'push', seed=0, variations={'object_shape': shape}, object_mesh=mesh, **options, **place
        )
        chosen = fetch_composer.load(
            'push', seed=0, **object_shapes.chosen(shape, mesh), **options, **place
        )
        seen, expected = drawn.reset().observation, chosen.reset().observation
        for name in ('close_rgb', 'close_goal_rgb'):
            np.testing.assert_allclose(seen[name].astype(int), expected[name].astype(int), atol=8)
            pictures[shape, name] = seen[name].astype(int)
    for name in ('close_rgb', 'close_goal_rgb'):
        change = np.abs(pictures['capsule', name] - pictures['mesh', name])
        assert (change > 20).any(axis=-1).sum() > 5


def test_pictures_of_a_batch_are_those_of_single_environments(mesh):
    small = {'height': 32, 'width': 32}
    options = {'observation_mode': 'pixels', 'pixels': small, **object_shapes.drawn(mesh)}
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0, **options).reset().observation
    for i, picture in enumerate(batch['corner_rgb']):
        single = fetch_composer.load('push', seed=i, **options).reset().observation['corner_rgb']
        np.testing.assert_array_equal(picture, single)
