"""Pictures in the batch, and pictures of goals, single and batch."""

import gymnasium as gym
import numpy as np
import pytest
from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import tasks
from fetch_composer.tasks import reach
from tests import episodes

_PIXELS = {
    'cameras': ('corner', 'fetch/gripper/gripper_camera'),
    'height': 20,
    'width': 24,
    'goal': True,
}
_NUM_ENVS = 2


def _made(task_name, pixels=_PIXELS, mode='features+pixels', **options):
    options = {'observation_mode': mode, 'pixels': pixels, **options}
    batch = fetch_composer.BatchEnvironment(task_name, _NUM_ENVS, seed=3, **options)
    singles = [fetch_composer.load(task_name, seed=3 + i, **options) for i in range(_NUM_ENVS)]
    return batch, singles


def _assert_rows(observation, singles):
    assert list(observation) == list(singles[0])
    for name, rows in observation.items():
        for row, single in zip(rows, singles, strict=True):
            assert row.dtype == single[name].dtype
            np.testing.assert_array_equal(row, single[name], err_msg=name)


@pytest.mark.parametrize(
    ('task_name', 'convention'),
    [
        ('slide', 'documented'),
        ('pick_and_place', 'gymnasium_robotics'),
    ],
)
def test_rows_are_the_pictures_of_single_environments(task_name, convention):
    """From one episode into the next."""
    batch, singles = _made(task_name, convention=convention, max_episode_steps=4)
    _assert_rows(batch.reset().observation, [single.reset().observation for single in singles])
    seen = set()
    for actions in episodes.uniform_actions(7, batch_shape=(_NUM_ENVS,)):
        observation = batch.step(actions).observation
        expected = [s.step(a).observation for s, a in zip(singles, actions, strict=True)]
        _assert_rows(observation, expected)
        seen.add(observation['corner_goal_rgb'][0].tobytes())
    assert len(seen) == 2, 'one for each episode'


def test_every_kind_of_picture_and_every_variation():
    pixels = {**_PIXELS, 'cameras': 'close', 'depth': True, 'segmentation': True, 'shadows': True}
    variations = {
        'object_size': distributions.Uniform(0.015, 0.03),
        'object_color': distributions.Uniform((0, 0, 0), (1, 1, 1)),
        'light_position': distributions.Uniform((1, -1, 2.5), (3, 2, 3.5)),
        'camera_offset': distributions.Uniform((-0.1,) * 3, (0.1,) * 3),
        'gripper_offset': distributions.Uniform((-0.05,) * 3, (0.05,) * 3),
    }
    batch, singles = _made(
        'pick_and_place', pixels, 'pixels', variations=variations, max_episode_steps=2
    )
    names = {
        f'close{of}_{kind}' for of in ('', '_goal') for kind in ('rgb', 'depth', 'segmentation')
    }
    assert set(batch.observation_spec()) == {*names, 'achieved_goal', 'desired_goal'}
    observation = batch.reset().observation
    _assert_rows(observation, [single.reset().observation for single in singles])
    for actions in episodes.uniform_actions(5, batch_shape=(_NUM_ENVS,)):
        observation = batch.step(actions).observation
        expected = [s.step(a).observation for s, a in zip(singles, actions, strict=True)]
        _assert_rows(observation, expected)
    for name, spec in batch.observation_spec().items():
        assert observation[name].shape == spec.shape and observation[name].dtype == spec.dtype


@pytest.mark.parametrize(
    ('task_name', 'convention'), [('push', 'documented'), ('pick_and_place', 'gymnasium_robotics')]
)
def test_a_restored_state_looks_as_it_did(task_name, convention):
    """In another row, which a reset of the first leaves alone, and in a single environment."""
    batch, singles = _made(task_name, convention=convention)
    batch.reset()
    for actions in episodes.uniform_actions(3, batch_shape=(_NUM_ENVS,)):
        seen = batch.step(actions).observation
    first, _ = batch.get_states()
    batch.set_states([first], [1])
    again = batch.reset([0]).observation
    for name in ('corner_rgb', 'corner_goal_rgb'):
        assert (again[name][0] != seen[name][0]).any(), 'It has been reset.'
        assert not np.shares_memory(again[name], seen[name])
    singles[0].set_state(first)
    physics = singles[0].physics
    for name, observed in singles[0].task.task_observables.items():
        if name.endswith('_rgb'):
            np.testing.assert_array_equal(again[name][1], seen[name][0], err_msg=name)
            picture = observed.observation_callable(physics, np.random.RandomState(0))()
            np.testing.assert_array_equal(picture, seen[name][0], err_msg=name)


@pytest.mark.parametrize('convention', ['documented', 'gymnasium_robotics'])
def test_pictures_of_goals_change_nothing_else(convention):
    options = {'observation_mode': 'features+pixels', 'convention': convention, 'seed': 0}
    plain, seeing = (
        fetch_composer.load('pick_and_place', pixels={**_PIXELS, 'goal': goal}, **options)
        for goal in (False, True)
    )
    actions = episodes.uniform_actions(6)
    for one, other in zip(episodes.run(plain, actions), episodes.run(seeing, actions), strict=True):
        for name, value in one.observation.items():
            np.testing.assert_array_equal(other.observation[name], value)


def test_a_picture_of_a_goal_shows_the_object_there():
    goal = (1.25, 0.6, 0.425)
    pixels = {'cameras': 'front', 'height': 96, 'width': 96, 'segmentation': True, 'goal': True}
    env = fetch_composer.load(
        'push', observation_mode='pixels', pixels=pixels, goal=goal, object_position=(1.45, 0.95)
    )

    def block(picture):
        return picture[..., 0] == env.physics.model.name2id('block/block', 'geom')

    observation = env.reset().observation
    start, shown = (block(observation[f'front{of}_segmentation']) for of in ('', '_goal'))
    assert shown.sum() > 10 and not (start & shown).any()
    env.task.set_next_episode(object_position=goal[:2])
    there = block(env.reset().observation['front_segmentation'])
    assert (there & shown).sum() > 0.6 * there.sum(), 'The rest is behind the gripper.'


def test_gymnasiums_vector_sees_what_its_own_does():
    mode = 'SameStep'
    kwargs = {'observation_mode': 'pixels', 'pixels': _PIXELS, 'max_episode_steps': 3}
    native = gym.make_vec('fetch_composer/FetchPush-v2', 2, autoreset_mode=mode, **kwargs)
    other = gym.make_vec(
        'fetch_composer/FetchPush-v2', 2, 'sync', vector_kwargs={'autoreset_mode': mode}, **kwargs
    )
    assert native.observation_space == other.observation_space
    steps = [(native.reset(seed=1), other.reset(seed=1))]
    for actions in episodes.uniform_actions(4, batch_shape=(2,)):
        steps.append((native.step(actions), other.step(actions)))
    for (mine, *_, info), (theirs, *_, other_info) in steps:
        assert native.observation_space.contains(mine)
        pairs = [(mine, theirs)]
        if 'final_obs' in info:
            pairs += zip(info['final_obs'], other_info['final_obs'], strict=True)
        for one, another in pairs:
            for name, value in one.items():
                np.testing.assert_array_equal(value, another[name], err_msg=name)
    assert any('final_obs' in info for (*_, info), _ in steps)


class _Adding(reach.Reach):
    """Reach that observes something of its own."""

    conventions = ('documented',)

    def _build_task_observables(self):
        observables = super()._build_task_observables()
        observables['extra'] = observables['achieved_goal']
        return observables


def test_what_a_task_adds_is_not_observed_in_a_batch():
    tasks.register('adding')(_Adding)
    with pytest.raises(ValueError, match='does not observe extra'):
        fetch_composer.BatchEnvironment('adding', 2)
