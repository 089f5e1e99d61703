"""What touches what: bodies that a user adds, in a single environment and in a batch alike."""

import mujoco
import numpy as np
import pytest
from dm_control import mjcf
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import entities, tasks
from fetch_composer.entities import contact_pairs
from fetch_composer.tasks import samplers, tabletop
from tests import episodes

_NUM_ENVS = 2
_DROP = 0.06  # m
_HALF_SIZE = 0.02  # m, of a dropped prop.
_PLACE = (1.3, 0.6)  # m, of the block.
_WALL_X = 1.15  # m


class _Crowded(tasks.GoalTask):
    """Push, with a prop that falls on the table, one that falls on the block, and a wall."""

    def __init__(self, options=tasks.TaskOptions()):  # noqa: B008
        block = entities.Block(quaternion=options.object_quaternion)
        super().__init__(options, tabletop.WORKSPACE, (block,))
        top = self.workspace.table_top
        for name, (x, y), below in (
            ('on_table', (1.45, 0.9), top),
            ('on_block', _PLACE, top + 2 * block.half_height),
        ):
            prop = entities.Block(size=(_HALF_SIZE,) * 3, mass=0.5, name=name)
            self.scene.add_prop(prop, (x, y, below + _HALF_SIZE + _DROP))
        # Its contact bits are MuJoCo's own.
        self.scene.arena.mjcf_model.worldbody.add(
            'geom', name='wall', type='box', size=(0.02, 0.3, 0.3), pos=(_WALL_X, 0.75, 0.7)
        )

    def _build_samplers(self):
        height = self.object_height
        return samplers.OffsetBeyond(self.grip_start, 0.15, 0.1), samplers.GoalAround(
            self.grip_start, 0.15, height
        )


@pytest.fixture(scope='module')
def crowded():
    tasks.register('crowded')(_Crowded)
    return 'crowded'


def test_what_a_user_adds_touches_everything(crowded):
    """In a batch as in single environments, to the bit."""
    options = {'object_position': _PLACE, 'max_episode_steps': None}
    batch = fetch_composer.BatchEnvironment(crowded, _NUM_ENVS, seed=0, **options)
    singles = [fetch_composer.load(crowded, seed=i, **options) for i in range(_NUM_ENVS)]
    batch.reset()
    for single in singles:
        single.reset()
    into_the_wall = np.array((-1, 0, 0, 0), np.float32)
    for _ in range(30):
        batch.step(np.tile(into_the_wall, (_NUM_ENVS, 1)))
        observations = [single.step(into_the_wall).observation for single in singles]
    for single, state in zip(singles, batch.get_states(), strict=True):
        np.testing.assert_array_equal(state.physics, single.get_state().physics)
    qpos, top = singles[0].physics.named.data.qpos, singles[0].task.workspace.table_top
    assert qpos['on_table/free/'][2] == pytest.approx(top + _HALF_SIZE, abs=2e-3)
    assert qpos['on_block/free/'][2] == pytest.approx(top + 0.05 + _HALF_SIZE, abs=2e-3)
    fingers = observations[0]['observation'][0]
    assert fingers == pytest.approx(_WALL_X + 0.02, abs=0.05), 'It would be at 0.7 m by now.'


def test_what_a_user_adds_to_a_single_environment_is_touched():
    env = fetch_composer.load('push', seed=0, object_position=_PLACE)
    prop = entities.Block(size=(_HALF_SIZE,) * 3, mass=0.5, name='prop')
    env.task.scene.add_prop(prop, (*_PLACE, 0.45 + _HALF_SIZE + _DROP))
    env.reset()
    for _ in range(30):
        env.step(np.zeros(4, np.float32))
    assert env.physics.named.data.qpos['prop/free/'][2] == pytest.approx(0.47, abs=2e-3)


@pytest.mark.parametrize('name', ['push', 'slide'])
def test_friction_that_varies_is_the_same_in_a_batch(name):
    variations = {'friction': distributions.Uniform(0.05, 1.0)}
    batch = fetch_composer.BatchEnvironment(name, _NUM_ENVS, seed=2, variations=variations)
    singles = [
        fetch_composer.load(name, seed=2 + i, variations=variations) for i in range(_NUM_ENVS)
    ]
    batch.reset()
    expected = [single.reset() for single in singles]
    for _ in range(80):
        actions = np.array([episodes.push_through(each.observation) for each in expected])
        batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]
    for single, state in zip(singles, batch.get_states(), strict=True):
        np.testing.assert_array_equal(state.physics, single.get_state().physics)


def _heap(seed: int) -> mjcf.RootElement:
    """Returns overlapping geoms of all kinds of contact parameters, on hinges."""
    rng = np.random.default_rng(seed)
    root = mjcf.RootElement()
    root.worldbody.add('geom', type='plane', size=(1, 1, 1), margin=0.2)
    body = root.worldbody
    for i in range(12):
        parent = body if i % 3 else root.worldbody
        body = parent.add('body', name=f'body{i}', pos=rng.uniform(-0.3, 0.3, 3))
        body.add('joint', type='hinge')
        for _ in range(rng.integers(1, 3)):
            body.add(
                'geom',
                type=rng.choice(['sphere', 'box', 'capsule']),
                size=rng.uniform(0.05, 0.15, 3),
                pos=rng.uniform(-0.2, 0.2, 3),
                mass=1,
                margin=rng.uniform(0, 0.1),
                gap=rng.uniform(0, 0.05),
                friction=rng.uniform(0.1, 1, 3),
                solref=((0.02, 1), (0.01, 1.1), (-100, -10))[rng.integers(3)],
                solimp=(0.9, rng.uniform(0.9, 0.99), 0.01),
                solmix=rng.choice([0.0, 1.0, 2.0]),
                priority=int(rng.integers(2)),
                condim=int(rng.choice([1, 3, 4, 6])),
                contype=int(rng.integers(4)),
                conaffinity=int(rng.integers(4)),
            )
    root.contact.add('exclude', body1='body1', body2='body7')
    geoms = root.find_all('geom')
    root.contact.add('pair', geom1=geoms[-1], geom2=geoms[1], condim=3)
    return root


def _contacts(physics) -> list[tuple]:
    mujoco.mj_forward(physics.model.ptr, physics.data.ptr)
    return [
        (each.geom1, each.geom2, each.dim, each.dist, each.includemargin, *each.friction,
         *each.solref, *each.solimp, *each.pos, *each.frame)
        for each in physics.data.contact
    ]  # fmt: skip


@pytest.mark.parametrize('seed', range(3))
def test_explicit_pairs_touch_as_what_mujoco_finds(seed):
    expected = _contacts(mjcf.Physics.from_mjcf_model(_heap(seed)))
    root = _heap(seed)
    assert contact_pairs.name(root)
    physics = mjcf.Physics.from_mjcf_model(root)
    contact_pairs.stop_search(physics.model.ptr)
    assert len(expected) > 20
    assert _contacts(physics) == expected


def test_a_crowd_is_left_to_mujocos_search():
    root = mjcf.RootElement()
    for i in range(20):
        body = root.worldbody.add('body', pos=(i, 0, 0))
        body.add('freejoint')
        body.add('geom', size=(0.1,))
    assert not contact_pairs.name(root)
    assert not root.find_all('contact')
