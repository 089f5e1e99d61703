"""The vector environment: autoreset modes, pictures and wrappers, beside Gymnasium's own."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as vector_wrappers

from fetch_composer.interfaces import gymnasium_vector
from tests import episodes

pytestmark = pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning')

_PUSH = 'fetch_composer/FetchPush-v2'
# Episodes end at different times: as goals are achieved, and all that are left after 6 steps.
_ENDING = {'max_episode_steps': 6, 'terminate_on_success': True}


def _pair(mode, num_envs=6, **options):
    """Returns the native batch, and Gymnasium's own vector of single environments."""
    native = gym.make_vec(_PUSH, num_envs, autoreset_mode=mode, **options)
    other = gym.make_vec(_PUSH, num_envs, 'sync', vector_kwargs={'autoreset_mode': mode}, **options)
    assert isinstance(native.unwrapped, gymnasium_vector.FetchVectorEnv)
    assert native.metadata['autoreset_mode'] == other.metadata['autoreset_mode'] == mode
    return native, other


def _assert_same(one, another):
    """Asserts that nested dictionaries and tuples of arrays are equal to the bit."""
    assert type(one) is type(another)
    if isinstance(one, dict):
        assert sorted(one) == sorted(another)
        for name, value in one.items():
            _assert_same(value, another[name])
    elif isinstance(one, tuple) or isinstance(one, np.ndarray) and one.dtype == object:
        for mine, theirs in zip(one, another, strict=True):
            _assert_same(mine, theirs)
    elif one is not None:
        assert one.dtype == another.dtype and one.shape == another.shape
        np.testing.assert_array_equal(one, another)


@pytest.mark.parametrize('mode', list(AutoresetMode))
def test_every_mode_is_that_of_gymnasiums_own_vector(mode):
    """Observations, rewards, ends and infos, as episodes end at different times."""
    native, other = _pair(mode, **_ENDING)
    _assert_same(native.reset(seed=6), other.reset(seed=6))
    ends = set()
    for actions in episodes.uniform_actions(16, batch_shape=(6,)):
        mine, theirs = native.step(actions), other.step(actions)
        _assert_same(mine, theirs)
        _, _, terminated, truncated, _ = mine
        done = terminated | truncated
        ends |= {(bool(a), bool(b)) for a, b in zip(terminated, truncated, strict=True)}
        if mode == AutoresetMode.DISABLED and done.any():
            with pytest.raises(RuntimeError, match=r'have ended.*reset_mask'):
                native.step(actions)
            _assert_same(
                native.reset(options={'reset_mask': done}),
                other.reset(options={'reset_mask': done}),
            )
    assert ends >= {(False, False), (True, False), (False, True)}
    assert mode != AutoresetMode.SAME_STEP or 'final_obs' in _last_infos(native)


def _last_infos(env):
    """Returns the infos of the next step in which an episode ends."""
    for actions in episodes.uniform_actions(7, batch_shape=(6,)):
        *_, infos = env.step(actions)
        if 'final_obs' in infos:
            return infos
    return {}


def test_an_unknown_mode_is_answered_with_the_valid_ones():
    with pytest.raises(ValueError, match="valid are 'NextStep', 'SameStep', 'Disabled'"):
        gym.make_vec(_PUSH, 2, autoreset_mode='next')
    assert gym.make_vec(_PUSH, 2, autoreset_mode='SameStep').metadata['autoreset_mode'] == (
        AutoresetMode.SAME_STEP
    )
    default = gymnasium_vector.FetchVectorEnv.metadata['autoreset_mode']
    assert default == AutoresetMode.NEXT_STEP, 'of the class, whatever its instances have'


_PICTURE = {'width': 64, 'height': 48, 'camera_name': 'front'}


@pytest.mark.parametrize(('version', 'mode'), [('v2', 'rgb_array'), ('v4', 'depth_array')])
def test_pictures_of_chosen_rows_are_those_of_single_environments(version, mode):
    env_id = f'fetch_composer/FetchPush-{version}'
    options = {'render_mode': mode, **_PICTURE}
    vector = gym.make_vec(env_id, 3, render_ids=[2, 0], **options)
    vector.reset(seed=4)
    for actions in episodes.uniform_actions(5, batch_shape=(3,)):
        vector.step(actions)
    pictures = vector.render()
    assert isinstance(pictures, tuple) and len(pictures) == 2
    single = gym.make(env_id, **options).unwrapped
    single.reset(seed=99)
    for row, picture in zip((2, 0), pictures, strict=True):
        single.set_state(vector.get_states([row])[0])
        np.testing.assert_array_equal(picture, single.render())
    assert (pictures[0] != pictures[1]).any()
    vector.close()


def test_a_picture_shows_what_a_single_environment_that_got_there_shows():
    vector = gym.make_vec(_PUSH, 2, render_mode='rgb_array', **_PICTURE)
    singles = [gym.make(_PUSH, render_mode='rgb_array', **_PICTURE) for _ in range(2)]
    vector.reset(seed=7)
    for i, single in enumerate(singles):
        single.reset(seed=7 + i)
    for actions in episodes.uniform_actions(5, batch_shape=(2,)):
        vector.step(actions)
        for single, action in zip(singles, actions, strict=True):
            single.step(action)
    np.testing.assert_array_equal(vector.render(), [single.render() for single in singles])


def test_taking_pictures_changes_nothing():
    one, other = (gym.make_vec(_PUSH, 2, render_mode=m, **_PICTURE) for m in ('rgb_array', None))
    for env in one, other:
        env.reset(seed=1)
    for actions in episodes.uniform_actions(3, batch_shape=(2,)):
        _assert_same(one.step(actions), other.step(actions))
        one.render()
    with pytest.warns(UserWarning, match='render_mode'):
        assert other.render() is None


def test_unknown_rows_cameras_and_modes_are_answered_with_the_valid_ones():
    with pytest.raises(ValueError, match='valid are rgb_array, depth_array'):
        gym.make_vec(_PUSH, 2, render_mode='human')
    with pytest.raises(ValueError, match='from 0 to 1'):
        gym.make_vec(_PUSH, 2, render_mode='rgb_array', render_ids=[2])
    with pytest.raises(ValueError, match='valid are front, corner'):
        gym.make_vec(_PUSH, 2, render_mode='rgb_array', camera_name='back')


_NEXT, _SAME = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP


def _normalized(env):
    return vector_wrappers.NormalizeObservation(vector_wrappers.FlattenObservation(env))


@pytest.mark.parametrize(
    ('wrap', 'mode'),
    [
        (vector_wrappers.RecordEpisodeStatistics, _NEXT),
        (vector_wrappers.RecordEpisodeStatistics, _SAME),
        (vector_wrappers.NormalizeReward, _SAME),
        (lambda env: vector_wrappers.RescaleAction(env, -2.0, 2.0), _SAME),
        (vector_wrappers.DictInfoToList, _SAME),
        (_normalized, _NEXT),  # Wrappers of observations refuse `SAME_STEP`.
    ],
)
def test_gymnasiums_vector_wrappers_do_as_on_its_own_vector(wrap, mode):
    native, other = (wrap(env) for env in _pair(mode, 3, **_ENDING))
    _assert_alike(native.reset(seed=9), other.reset(seed=9))
    for actions in episodes.uniform_actions(20, batch_shape=(3,)):
        _assert_alike(native.step(actions), other.step(actions))


def _assert_alike(one, another):
    """As `_assert_same`, but for the time that episodes took, and for lists of infos."""
    *one, info = one
    *another, other_info = another
    _assert_same(tuple(one), tuple(another))
    if isinstance(info, list):
        for mine, theirs in zip(info, other_info, strict=True):
            assert sorted(mine) == sorted(theirs)
        return
    for each in (info, other_info):
        each.get('episode', {}).pop('t', None)
        each.get('episode', {}).pop('_t', None)
    _assert_same(info, other_info)


def test_seeds_are_for_those_that_are_reset_and_none_goes_on():
    native, other = _pair(AutoresetMode.NEXT_STEP, num_envs=3)
    mask = np.array([True, False, True])
    for seed in (100, [7, 8, 9], [7, None, None]):
        for each in (native, other):
            each.reset(seed=0)
            each.step(np.zeros((3, 4), np.float32))
        kept = {'options': {'reset_mask': mask}, 'seed': seed}
        _assert_same(native.reset(**kept), other.reset(**kept))
        _assert_same(native.reset(), other.reset())
        _assert_same(native.reset(seed=seed), other.reset(seed=seed))


@pytest.mark.parametrize('mask', [[1, 0], [0, 1], [True], np.ones(2), 'all'])
def test_a_mask_of_what_to_reset_is_of_booleans(mask):
    vector = gym.make_vec('fetch_composer/FetchPush-v2', num_envs=2)
    vector.reset(seed=0)
    vector.step(np.zeros((2, 4), np.float32))
    with pytest.raises(ValueError, match='reset_mask must be 2 booleans'):
        vector.reset(options={'reset_mask': mask})
    assert vector.batch.steps_taken.tolist() == [1, 1]
