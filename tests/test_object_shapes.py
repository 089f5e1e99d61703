"""Objects of other shapes: chosen for all episodes, or drawn for each."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import entities, tasks
from fetch_composer.entities import shapes
from fetch_composer.environment import Environment
from fetch_composer.tasks import samplers, tabletop
from fetch_composer.tasks.state import State
from tests import episodes

_ROOT = pathlib.Path(__file__).parents[1]
_OTHERS = ('pick_and_place', 'slide', 'push_around')  # Of one object.
_TABLE_TOP = 0.4
# A wedge: neither its middle nor its axes are those of its inertia.
_VERTICES = np.array(
    ((0, 0, 0), (6, 0, 0), (6, 4, 0), (0, 4, 0), (0, 0, 2), (0, 4, 2)), dtype=np.float64
)
_FACES = ((0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 5), (1, 5, 4), (2, 3, 5), (0, 4, 5), (0, 5, 3))


def _write_obj(path, vertices, faces=_FACES):
    lines = ['v {} {} {}'.format(*each) for each in vertices]
    lines += ['f {} {} {}'.format(*(i + 1 for i in each)) for each in faces]
    path.write_text('\n'.join(lines))
    return str(path)


@pytest.fixture(scope='module')
def mesh():
    return str(pathlib.Path(__file__).with_name('wedge.obj'))


@pytest.fixture(params=shapes.NAMES)
def shape(request):
    return request.param


def _chosen(shape, mesh):
    return {'object_shape': shape, **({'object_mesh': mesh} if shape == 'mesh' else {})}


def _drawn(mesh, choices=shapes.NAMES):
    return {
        'variations': {'object_shape': distributions.UniformChoice(choices)},
        'object_mesh': mesh,
    }


def _geom_type(env):
    return shapes.NAMES[[6, 5, 3, 4, 7].index(env.physics.model.geom_type[_geom(env)])]


def _geom(env):
    return env.physics.bind(env.task.scene.objects[0].geom).element_id


def _corners_of(env):
    """Returns the bounding box of the object's surface points in the world, sampled in m."""
    model, data, geom = env.physics.model.ptr, env.physics.data.ptr, _geom(env)
    first = model.mesh_vertadr[model.geom_dataid[geom]]
    vertices = model.mesh_vert[first : first + model.mesh_vertnum[model.geom_dataid[geom]]]
    return data.geom_xpos[geom] + vertices @ data.geom_xmat[geom].reshape(3, 3).T


@pytest.mark.parametrize(
    ('name', 'shape'),
    [*(('push', shape) for shape in shapes.NAMES), *((name, 'capsule') for name in _OTHERS)],
)
def test_an_object_of_any_shape_rests_where_it_starts(name, shape, mesh):
    env = fetch_composer.load(name, seed=1, max_episode_steps=None, **_chosen(shape, mesh))
    start = env.reset().observation
    assert _geom_type(env) == shape
    np.testing.assert_allclose(start['observation'][11:14], 0, atol=1e-9)  # It is upright.
    for _ in range(25):
        observation = env.step(np.zeros(4, np.float32)).observation
    np.testing.assert_allclose(observation['achieved_goal'], start['achieved_goal'], atol=1e-3)
    half_height = env.task.scene.objects[0].half_height
    assert abs(start['achieved_goal'][2] - _TABLE_TOP - half_height) < 2e-4
    assert abs(start['desired_goal'][2] - start['achieved_goal'][2]) < 1e-6 or name != 'push'


@pytest.mark.parametrize('name', ['push', 'slide'])
def test_mass_friction_and_colour_are_those_of_the_tasks_own_object(name, shape, mesh):
    own = fetch_composer.load(name)
    other = fetch_composer.load(name, **_chosen(shape, mesh))
    for field in ('geom_friction', 'geom_solref', 'geom_contype', 'geom_conaffinity'):
        values = [getattr(env.physics.model, field)[_geom(env)] for env in (own, other)]
        np.testing.assert_array_equal(*values)
    blocks = [env.task.scene.objects[0] for env in (own, other)]
    masses = [
        env.physics.model.body_mass[env.physics.model.geom_bodyid[_geom(env)]]
        for env in (own, other)
    ]
    assert masses == pytest.approx([2.0, 2.0])
    np.testing.assert_array_equal(*(block.rgba for block in blocks))


@pytest.mark.parametrize('size', [(0.03, 0.02, 0.01), (0.02,)])
def test_the_middle_of_a_mesh_is_observed_and_its_box_has_the_chosen_size(mesh, size):
    env = fetch_composer.load('push', seed=0, object_size=size, **_chosen('mesh', mesh))
    centre = env.reset().observation['achieved_goal']
    corners = _corners_of(env)
    half = np.array(size) if len(size) == 3 else 0.02 * np.array((3, 2, 1)) / 3
    np.testing.assert_allclose(corners.min(axis=0), centre - half, atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), centre + half, atol=1e-6)


def test_a_mesh_is_read_from_stl_as_well(mesh, tmp_path):
    path = tmp_path / 'wedge.STL'
    facets = np.zeros(len(_FACES), [('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('_', '<u2')])
    facets['corners'] = _VERTICES[np.array(_FACES)]
    path.write_bytes(bytes(80) + np.uint32(len(_FACES)).tobytes() + facets.tobytes())
    one, other = (
        fetch_composer.load('push', seed=0, **_chosen('mesh', str(each))) for each in (mesh, path)
    )
    for _ in range(2):
        np.testing.assert_allclose(
            one.reset().observation['observation'], other.reset().observation['observation']
        )
    inertia = [env.physics.model.body_inertia[-1] for env in (one, other)]
    np.testing.assert_allclose(*inertia, rtol=1e-4)


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
    other = fetch_composer.load('push', seed=0, **_chosen(shape, mesh))
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


def test_an_object_aligned_with_its_body_takes_any_shape_too(shape, mesh):
    """MuJoCo's shortcuts for aligned bodies do not outlast the shape that they hold for."""
    drawn = {'variations': {'object_shape': shape}, 'object_mesh': mesh}
    pair = [
        Environment(_AlignedBlock(**each), random_state=0) for each in (drawn, _chosen(shape, mesh))
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
    own = _write_obj(tmp_path / 'own.obj', _VERTICES * (1, 2, 3))
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
    one, other = (fetch_composer.load('push', seed=3, **_drawn(mesh)) for _ in range(2))
    found = []
    for _ in range(30):
        episodes.assert_same([one.reset()], [other.reset()])
        assert _geom_type(one) == _geom_type(other)
        found.append(_geom_type(one))
    assert set(found) == set(shapes.NAMES)


@pytest.mark.parametrize('name', ['push', 'pick_and_place', 'push_two'])
@pytest.mark.parametrize('rows', [1, 3])
def test_rows_of_a_batch_are_single_environments_of_the_same_shapes(name, rows, mesh):
    options = {**_drawn(mesh), 'max_episode_steps': 15}
    batch = fetch_composer.BatchEnvironment(name, rows, seed=1, **options)
    singles = [fetch_composer.load(name, seed=1 + i, **options) for i in range(rows)]
    batched, expected = batch.reset(), [single.reset() for single in singles]
    seen = set()
    for _ in range(70):
        seen.update(_geom_type(each) for each in singles)
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


def test_a_batch_of_a_chosen_shape_is_single_environments_too(shape, mesh):
    options = _chosen(shape, mesh)
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0, **options)
    singles = [fetch_composer.load('push', seed=i, **options) for i in range(2)]
    batched, expected = batch.reset(), [single.reset() for single in singles]
    for _ in range(40):
        actions = np.array([episodes.push_through(each.observation) for each in expected])
        batched = batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]
    for i, each in enumerate(expected):
        np.testing.assert_allclose(
            batched.observation['observation'][i], each.observation['observation'], atol=1e-9
        )


def test_several_objects_all_have_the_shape(mesh):
    env = fetch_composer.load('stack', seed=0, **_chosen('mesh', mesh))
    goal = env.reset().observation['desired_goal']
    geoms = [env.physics.bind(each.geom).element_id for each in env.task.scene.objects]
    assert set(env.physics.model.geom_type[geoms]) == {7}
    half_height = env.task.scene.objects[0].half_height
    np.testing.assert_allclose(goal[[2, 5]] - _TABLE_TOP, (half_height, 3 * half_height), atol=1e-9)
    drawn = fetch_composer.load(
        'stack', seed=0, variations={'object_shape': 'mesh'}, object_mesh=mesh
    )
    np.testing.assert_allclose(drawn.reset().observation['desired_goal'], goal, atol=1e-9)


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
    env = fetch_composer.load('push', seed=0, **_drawn(mesh))
    while env.reset() and _geom_type(env) in ('box', 'cylinder'):
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
    env = fetch_composer.load('push', seed=0, **_drawn(mesh))
    batch = fetch_composer.BatchEnvironment('push', 2, seed=7, **_drawn(mesh))
    for _ in range(4):
        env.reset()
        batch.set_states([env.get_state()] * 2)
        single = [env.step(np.full(4, 0.3)) for _ in range(5)][-1]
        rows = [batch.step(np.full((2, 4), 0.3)) for _ in range(5)][-1]
        for row in rows.observation['observation']:
            np.testing.assert_allclose(row, single.observation['observation'], atol=1e-9)


def test_states_of_other_shapes_are_refused(mesh, tmp_path):
    env = fetch_composer.load('push', seed=0, object_shape='box')
    env.reset()
    for options in (_chosen('cylinder', mesh), _chosen('mesh', mesh), {'object_size': 0.03}):
        with pytest.raises(ValueError, match='differs in model'):
            fetch_composer.load('push', **{'object_shape': 'box', **options}).set_state(
                env.get_state()
            )
    drawn = fetch_composer.load('push', seed=0, **_drawn(mesh))
    drawn.reset()
    other = _write_obj(tmp_path / 'other.obj', _VERTICES * (1, 2, 1))
    with pytest.raises(ValueError, match='differs in model'):
        fetch_composer.load('push', **_drawn(other)).set_state(drawn.get_state())
    state = drawn.get_state()
    for bad in (np.array(['ball']), np.array([1.0]), np.array(['box', 'box']), 'box'):
        changed = State(**{**vars(state), 'variations': {'object_shape': bad}})
        with pytest.raises(ValueError, match='object_shape'):
            drawn.set_state(changed)


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


def test_an_object_too_large_to_start_anywhere_is_refused():
    env = fetch_composer.load('push', seed=0, object_shape='capsule', object_size=0.09)
    with pytest.raises(ValueError, match='No place for objects of this object_size'):
        env.reset()


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'object_shape': 'ball'}, 'Unknown object_shape .*valid are box, cylinder, capsule'),
        ({'object_shape': 'mesh'}, 'needs an object_mesh'),
        ({'object_shape': 'box', 'object_size': (0.02, 0.02)}, 'must be 3 numbers, or one for all'),
        ({'object_shape': 'capsule', 'object_size': (0.02, 0.2)}, 'from 0.005 to 0.1 m'),
        ({'object_shape': 'box', 'object_size': float('nan')}, 'object_size of a box must be'),
        ({'object_size': (0.02, 0.02, 0.02)}, 'object_size is of an object_shape; give one of box'),
        ({'object_mesh': 'wedge.obj'}, "object_mesh is of the object_shape 'mesh'"),
        ({'object_shape': 'box', 'object_mesh': 'wedge.obj'}, "of the object_shape 'mesh'"),
        ({'object_shape': 'box', 'convention': 'gymnasium_robotics'}, 'has no object_shape'),
    ],
)
def test_what_makes_no_sense_is_refused(options, message):
    for make in (
        lambda: fetch_composer.load('push', **options),
        lambda: fetch_composer.BatchEnvironment('push', 2, **options),
        lambda: fetch_composer.suite.load('fetch', 'push', task_kwargs=options),
    ):
        with pytest.raises(ValueError, match=message):
            make()


def test_a_task_without_an_object_has_no_shape(mesh):
    for options in ({'object_shape': 'box'}, _chosen('mesh', mesh)):
        with pytest.raises(ValueError, match='object_shape was given, but this task has no object'):
            fetch_composer.load('reach', **options)
    with pytest.raises(ValueError, match='this task has no object'):
        fetch_composer.load('reach', variations={'object_shape': 'box'})


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


def test_what_a_mesh_or_a_settled_start_does_not_allow_is_refused(mesh):
    env = fetch_composer.load('push', variations={'object_size': 0.03}, **_chosen('mesh', mesh))
    with pytest.raises(ValueError, match='cannot vary for a mesh'):
        env.reset()
    with pytest.raises(ValueError, match='settled'):
        fetch_composer.load(
            'push', convention='gymnasium_robotics', variations={'object_shape': 'box'}
        )


@pytest.mark.parametrize(
    'kind', ['missing', 'empty', 'flat', 'text', 'infinite', 'other', 'number']
)
def test_a_file_that_holds_no_solid_is_named(kind, tmp_path):
    path = tmp_path / f'{kind}.{"txt" if kind == "other" else "obj"}'
    if kind in ('empty', 'text', 'other'):
        path.write_text('' if kind == 'empty' else 'no vertices here\n')
    elif kind == 'flat':
        _write_obj(path, _VERTICES * (1, 1, 0))
    elif kind == 'infinite':
        _write_obj(path, np.where(_VERTICES == 6, np.inf, _VERTICES))
    given = 7 if kind == 'number' else path
    for name in ('push', 'push_two'):
        with pytest.raises(ValueError, match='object_mesh.*' + ('7' if given == 7 else path.name)):
            fetch_composer.load(name, object_shape='mesh', object_mesh=given)


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
        chosen = fetch_composer.load('push', seed=0, **_chosen(shape, mesh), **options, **place)
        seen, expected = drawn.reset().observation, chosen.reset().observation
        for name in ('close_rgb', 'close_goal_rgb'):
            np.testing.assert_allclose(seen[name].astype(int), expected[name].astype(int), atol=8)
            pictures[shape, name] = seen[name].astype(int)
    for name in ('close_rgb', 'close_goal_rgb'):
        change = np.abs(pictures['capsule', name] - pictures['mesh', name])
        assert (change > 20).any(axis=-1).sum() > 5


def test_pictures_of_a_batch_are_those_of_single_environments(mesh):
    options = {
        'observation_mode': 'pixels', 'pixels': {'height': 32, 'width': 32}, **_drawn(mesh)
    }  # fmt: skip
    batch = fetch_composer.BatchEnvironment('push', 2, seed=0, **options).reset().observation
    for i, picture in enumerate(batch['corner_rgb']):
        single = fetch_composer.load('push', seed=i, **options).reset().observation['corner_rgb']
        np.testing.assert_array_equal(picture, single)


def test_gymnasium_takes_shapes(mesh):
    gym = pytest.importorskip('gymnasium')
    env = gym.make('fetch_composer/FetchPush-v2', object_shape='capsule')
    env.reset(seed=0)
    assert _geom_type(env.unwrapped.dm_env) == 'capsule'
    envs = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=2, object_shape='ellipsoid')
    observation, _ = envs.reset(seed=0)
    np.testing.assert_allclose(observation['achieved_goal'][:, 2], 0.42, atol=2e-4)
    with pytest.raises(ValueError, match='has no object_shape'):
        gym.make('fetch_composer/FetchPush-v4', object_shape='capsule')
