"""Variations: what differs between episodes, and only that."""

import numpy as np
import pytest
from dm_control import mjcf
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import tasks
from tests import episodes

_ALL = {
    'object_mass': distributions.Uniform(1.0, 3.0),
    'friction': distributions.Uniform(0.3, 1.0),
    'object_color': distributions.Uniform((0, 0, 0), (1, 1, 1)),
    'light_position': distributions.Uniform((1, -1, 2.5), (3, 2, 3.5)),
    'camera_offset': distributions.Uniform((-0.1,) * 3, (0.1,) * 3),
    'gripper_offset': distributions.Uniform((-0.05,) * 3, (0.05,) * 3),
}
_SIZES = {
    'push': distributions.Uniform((0.02, 0.02, 0.015), (0.03, 0.03, 0.03)),
    'pick_and_place': distributions.Uniform(0.02, 0.03),
    'slide': distributions.Uniform((0.02, 0.015), (0.03, 0.03)),
}


def _all(task_name):
    return {**_ALL, 'object_size': _SIZES[task_name]}


def test_every_episode_is_drawn_and_a_seed_fixes_it(object_task_name):
    actions = episodes.uniform_actions(20)
    environments = [
        fetch_composer.load(object_task_name, seed=2, variations=_all(object_task_name))
        for _ in range(2)
    ]
    sizes = []
    for _ in range(3):
        one, other = (episodes.run(env, actions) for env in environments)
        episodes.assert_same(one, other)
        model = environments[0].physics.named.model
        sizes.append(tuple(model.geom_size['block/block']))
    assert len(set(sizes)) == 3


def test_without_variations_starts_are_as_before(object_task_name):
    varied = fetch_composer.load(object_task_name, seed=4, variations={'object_mass': 1.5})
    plain = fetch_composer.load(object_task_name, seed=4)
    episodes.assert_same([varied.reset()], [plain.reset()])


def test_nothing_is_recompiled():
    env = fetch_composer.load('push', seed=0, variations=_all('push'))
    env.reset()
    model = env.physics.model.ptr
    env.reset()
    assert env.physics.model.ptr is model


@pytest.mark.parametrize(
    ('geom_type', 'size'), [('box', (0.03, 0.02, 0.015)), ('cylinder', (0.03, 0.015))]
)
def test_a_varied_object_is_the_object_compiled_that_way(geom_type, size):
    """Bounds, inertia and the solver's constants follow size and mass."""
    name = 'push' if geom_type == 'box' else 'slide'
    env = fetch_composer.load(name, seed=0, variations={'object_size': size, 'object_mass': 1.3})
    env.reset()
    varied = env.physics.model.ptr

    task = tasks.make(name)
    geom = task.scene.objects[0].geom
    geom.size, geom.mass = size, 1.3
    compiled = mjcf.Physics.from_mjcf_model(task.root_entity.mjcf_model).model.ptr
    for field in (
        'geom_size', 'geom_rbound', 'geom_aabb', 'body_mass', 'body_inertia', 'body_subtreemass',
        'body_invweight0', 'dof_invweight0', 'dof_M0', 'bvh_aabb', 'body_ipos', 'body_iquat',
    ):  # fmt: skip
        np.testing.assert_allclose(
            getattr(varied, field), getattr(compiled, field), rtol=1e-6, atol=1e-9, err_msg=field
        )


def test_an_object_of_any_size_rests_on_the_table(object_task_name):
    variations = {'object_size': _SIZES[object_task_name]}
    env = fetch_composer.load(
        object_task_name, seed=0, variations=variations, max_episode_steps=None
    )
    for _ in range(3):
        start = env.reset().observation['achieved_goal']
        for _ in range(10):
            observation = env.step(np.zeros(4, np.float32)).observation
        np.testing.assert_allclose(observation['achieved_goal'], start, atol=2e-4)


def test_objects_glide_less_far_the_rougher_the_table():
    def pushed(friction):
        env = fetch_composer.load(
            'slide', seed=0, variations={'friction': friction}, max_episode_steps=None
        )
        observation = env.reset().observation
        observation = episodes.push_until(env, observation, 0.8)
        for _ in range(30):
            observation = env.step(np.array([0, -1, 0, 0], np.float32)).observation
        return observation['achieved_goal'][1]

    assert pushed(0.05) > pushed(0.2) + 0.03 > pushed(0.6) + 0.03


def test_the_gripper_starts_where_it_is_drawn(task_name):
    env = fetch_composer.load(task_name, seed=0, variations={'gripper_offset': (0.03, -0.05, 0.04)})
    plain = fetch_composer.load(task_name, seed=0)
    moved = env.reset().observation['observation'][:3]
    start = plain.reset().observation['observation'][:3]
    np.testing.assert_allclose(moved - start, (0.03, -0.05, 0.04), atol=1e-5)
    held = [env.step(np.zeros(4, np.float32)).observation['observation'][:3] for _ in range(20)]
    np.testing.assert_allclose(held, [moved] * 20, atol=1e-3)


def test_a_batch_varies_each_environment_as_the_single_one(object_task_name):
    variations = _all(object_task_name)
    batch = fetch_composer.BatchEnvironment(object_task_name, 3, seed=1, variations=variations)
    singles = [
        fetch_composer.load(object_task_name, seed=1 + i, variations=variations) for i in range(3)
    ]
    time_step, expected = batch.reset(), [single.reset() for single in singles]
    for _ in range(70):
        for i, each in enumerate(expected):
            for name, value in each.observation.items():
                np.testing.assert_allclose(time_step.observation[name][i], value, rtol=0, atol=1e-9)
        actions = np.array([episodes.push_through(each.observation) for each in expected])
        time_step = batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]


def test_looks_vary_in_pictures_and_not_in_physics():
    looks = {k: _ALL[k] for k in ('object_color', 'light_position', 'camera_offset')}
    env = fetch_composer.load('push', seed=0, variations=looks)
    plain = fetch_composer.load('push', seed=0)
    actions = episodes.uniform_actions(10)
    episodes.assert_same(episodes.run(env, actions), episodes.run(plain, actions))
    pictures = []
    for _ in range(2):
        env.reset()
        pictures.append(env.physics.render(48, 64, camera_id='corner').astype(float))
    assert np.abs(pictures[0] - pictures[1]).mean() > 2


@pytest.mark.parametrize(
    ('variations', 'message'),
    [
        ({'gravity': 1}, 'valid are object_shape, object_size'),
        ({'object_mass': -1.0}, 'must be positive'),
        ({'object_mass': (1, 2)}, "the object's mass in kg"),
        ({'friction': np.nan}, 'sliding coefficient'),
        ({'object_size': (0.02, 0.03)}, 'this object has 3 sizes'),
    ],
)
def test_variations_that_make_no_sense_are_refused(variations, message):
    with pytest.raises(ValueError, match=message):
        fetch_composer.load('push', seed=0, variations=variations).reset()


def test_what_a_task_lacks_cannot_vary():
    with pytest.raises(ValueError, match='has no object'):
        fetch_composer.load('reach', variations={'object_mass': 1})
    with pytest.raises(ValueError, match='settled'):
        fetch_composer.load(
            'push', convention='gymnasium_robotics', variations={'gripper_offset': (0, 0, 0)}
        )


@pytest.mark.parametrize('name', ['push', 'pick_and_place'])
def test_no_object_starts_within_the_gripper(name):
    variations = {
        'object_size': distributions.Uniform((0.02, 0.02, 0.015), (0.035, 0.035, 0.03)),
        'gripper_offset': distributions.Uniform((-0.08,) * 3, (0.08,) * 3),
    }
    env = fetch_composer.load(name, seed=0, variations=variations)
    for _ in range(300):
        env.reset()
        model, data = env.physics.model.ptr, env.physics.data.ptr
        for contact in data.contact:
            names = {model.geom(contact.geom1).name, model.geom(contact.geom2).name}
            assert 'table/table' in names or contact.dist > -1e-4, names


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'variations': {'gripper_offset': (0, 0, -0.15)}}, 'starts the fingers in the table'),
        ({'variations': {'object_color': (5, -3, 0)}}, r'RGB or RGBA in \[0, 1\]'),
        (
            {
                'variations': {'gripper_offset': (0, 0, -0.08)},
                'object_position': (1.34, 0.75),
            },
            'is where the gripper starts',
        ),
    ],
)
def test_starts_that_cannot_be_are_refused(options, message):
    env = fetch_composer.load('push', seed=0, **options)
    with pytest.raises(ValueError, match=message):
        env.reset()


def test_a_goal_belongs_to_the_place_that_is_drawn_in_the_end():
    """Places that are in the way of large objects or of the gripper are drawn again."""
    large = {'object_size': distributions.Uniform((0.05,) * 3, (0.055,) * 3)}
    env = fetch_composer.load('push_around', seed=0, variations=large)
    wall = env.task.scene.obstacles[0].position[1]
    for _ in range(200):
        observation = env.reset().observation
        sides = [np.sign(observation[name][1] - wall) for name in ('achieved_goal', 'desired_goal')]
        assert sides[0] == -sides[1]
    low = {'gripper_offset': distributions.Uniform((0.05, 0.05, -0.1), (0.051, 0.051, -0.09))}
    env = fetch_composer.load('push_two', seed=0, variations=low)
    for _ in range(100):
        observation = env.reset().observation
        places, goals = (
            observation[name].reshape(2, 3)[:, :2] for name in ('achieved_goal', 'desired_goal')
        )
        assert np.linalg.norm(places[0] - goals[1]) > 0.1 < np.linalg.norm(places[1] - goals[0])
