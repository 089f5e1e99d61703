"""Objects of a chosen shape."""

import numpy as np
import pytest

import fetch_composer
from fetch_composer.entities import shapes
from fetch_composer.tasks.state import State
from tests import episodes, object_shapes

_OTHERS = ('pick_and_place', 'slide', 'push_around')  # Of one object.
_TABLE_TOP = 0.4


def _corners_of(env):
    """Returns the bounding box of the object's surface points in the world, sampled in m."""
    model, data, geom = env.physics.model.ptr, env.physics.data.ptr, object_shapes.geom(env)
    first = model.mesh_vertadr[model.geom_dataid[geom]]
    vertices = model.mesh_vert[first : first + model.mesh_vertnum[model.geom_dataid[geom]]]
    return data.geom_xpos[geom] + vertices @ data.geom_xmat[geom].reshape(3, 3).T


@pytest.mark.parametrize(
    ('name', 'shape'),
    [*(('push', shape) for shape in shapes.NAMES), *((name, 'capsule') for name in _OTHERS)],
)
def test_an_object_of_any_shape_rests_where_it_starts(name, shape, mesh):
    env = fetch_composer.load(
        name, seed=1, max_episode_steps=None, **object_shapes.chosen(shape, mesh)
    )
    start = env.reset().observation
    assert object_shapes.geom_type(env) == shape
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
    other = fetch_composer.load(name, **object_shapes.chosen(shape, mesh))
    for field in ('geom_friction', 'geom_solref', 'geom_contype', 'geom_conaffinity'):
        values = [
            getattr(env.physics.model, field)[object_shapes.geom(env)] for env in (own, other)
        ]
        np.testing.assert_array_equal(*values)
    blocks = [env.task.scene.objects[0] for env in (own, other)]
    masses = [
        env.physics.model.body_mass[env.physics.model.geom_bodyid[object_shapes.geom(env)]]
        for env in (own, other)
    ]
    assert masses == pytest.approx([2.0, 2.0])
    np.testing.assert_array_equal(*(block.rgba for block in blocks))


@pytest.mark.parametrize('size', [(0.03, 0.02, 0.01), (0.02,)])
def test_the_middle_of_a_mesh_is_observed_and_its_box_has_the_chosen_size(mesh, size):
    env = fetch_composer.load(
        'push', seed=0, object_size=size, **object_shapes.chosen('mesh', mesh)
    )
    centre = env.reset().observation['achieved_goal']
    corners = _corners_of(env)
    half = np.array(size) if len(size) == 3 else 0.02 * np.array((3, 2, 1)) / 3
    np.testing.assert_allclose(corners.min(axis=0), centre - half, atol=1e-6)
    np.testing.assert_allclose(corners.max(axis=0), centre + half, atol=1e-6)


def test_a_mesh_is_read_from_stl_as_well(mesh, tmp_path):
    path = tmp_path / 'wedge.STL'
    facets = np.zeros(
        len(object_shapes.FACES), [('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('_', '<u2')]
    )
    facets['corners'] = object_shapes.VERTICES[np.array(object_shapes.FACES)]
    path.write_bytes(bytes(80) + np.uint32(len(object_shapes.FACES)).tobytes() + facets.tobytes())
    one, other = (
        fetch_composer.load('push', seed=0, **object_shapes.chosen('mesh', str(each)))
        for each in (mesh, path)
    )
    for _ in range(2):
        np.testing.assert_allclose(
            one.reset().observation['observation'], other.reset().observation['observation']
        )
    inertia = [env.physics.model.body_inertia[-1] for env in (one, other)]
    np.testing.assert_allclose(*inertia, rtol=1e-4)


def test_a_batch_of_a_chosen_shape_is_single_environments_too(shape, mesh):
    options = object_shapes.chosen(shape, mesh)
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
    env = fetch_composer.load('stack', seed=0, **object_shapes.chosen('mesh', mesh))
    goal = env.reset().observation['desired_goal']
    geoms = [env.physics.bind(each.geom).element_id for each in env.task.scene.objects]
    assert set(env.physics.model.geom_type[geoms]) == {7}
    half_height = env.task.scene.objects[0].half_height
    np.testing.assert_allclose(goal[[2, 5]] - _TABLE_TOP, (half_height, 3 * half_height), atol=1e-9)
    drawn = fetch_composer.load(
        'stack', seed=0, variations={'object_shape': 'mesh'}, object_mesh=mesh
    )
    np.testing.assert_allclose(drawn.reset().observation['desired_goal'], goal, atol=1e-9)


def test_states_of_other_shapes_are_refused(mesh, tmp_path):
    env = fetch_composer.load('push', seed=0, object_shape='box')
    env.reset()
    for options in (
        object_shapes.chosen('cylinder', mesh),
        object_shapes.chosen('mesh', mesh),
        {'object_size': 0.03},
    ):
        with pytest.raises(ValueError, match='differs in model'):
            fetch_composer.load('push', **{'object_shape': 'box', **options}).set_state(
                env.get_state()
            )
    drawn = fetch_composer.load('push', seed=0, **object_shapes.drawn(mesh))
    drawn.reset()
    other = object_shapes.write_obj(tmp_path / 'other.obj', object_shapes.VERTICES * (1, 2, 1))
    with pytest.raises(ValueError, match='differs in model'):
        fetch_composer.load('push', **object_shapes.drawn(other)).set_state(drawn.get_state())
    state = drawn.get_state()
    for bad in (np.array(['ball']), np.array([1.0]), np.array(['box', 'box']), 'box'):
        changed = State(**{**vars(state), 'variations': {'object_shape': bad}})
        with pytest.raises(ValueError, match='object_shape'):
            drawn.set_state(changed)


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
    for options in ({'object_shape': 'box'}, object_shapes.chosen('mesh', mesh)):
        with pytest.raises(ValueError, match='object_shape was given, but this task has no object'):
            fetch_composer.load('reach', **options)
    with pytest.raises(ValueError, match='this task has no object'):
        fetch_composer.load('reach', variations={'object_shape': 'box'})


def test_what_a_mesh_or_a_settled_start_does_not_allow_is_refused(mesh):
    env = fetch_composer.load(
        'push', variations={'object_size': 0.03}, **object_shapes.chosen('mesh', mesh)
    )
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
        object_shapes.write_obj(path, object_shapes.VERTICES * (1, 1, 0))
    elif kind == 'infinite':
        object_shapes.write_obj(
            path, np.where(object_shapes.VERTICES == 6, np.inf, object_shapes.VERTICES)
        )
    given = 7 if kind == 'number' else path
    for name in ('push', 'push_two'):
        with pytest.raises(ValueError, match='object_mesh.*' + ('7' if given == 7 else path.name)):
            fetch_composer.load(name, object_shape='mesh', object_mesh=given)


def test_gymnasium_takes_shapes(mesh):
    gym = pytest.importorskip('gymnasium')
    env = gym.make('fetch_composer/FetchPush-v2', object_shape='capsule')
    env.reset(seed=0)
    assert object_shapes.geom_type(env.unwrapped.dm_env) == 'capsule'
    envs = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=2, object_shape='ellipsoid')
    observation, _ = envs.reset(seed=0)
    np.testing.assert_allclose(observation['achieved_goal'][:, 2], 0.42, atol=2e-4)
    with pytest.raises(ValueError, match='has no object_shape'):
        gym.make('fetch_composer/FetchPush-v4', object_shape='capsule')
