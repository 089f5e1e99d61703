"""Pictures as observations."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import env_checker

import fetch_composer
from tests import episodes

_PIXELS = {'cameras': ('front', 'fetch/head_camera'), 'height': 24, 'width': 32}


def test_pictures_take_the_place_of_features_or_stand_beside_them(task_name):
    goals = {'achieved_goal', 'desired_goal'}
    pictures = {'front_rgb', 'fetch/head_camera_rgb'}
    expected = {
        'features': {'observation', *goals},
        'pixels': {*pictures, *goals},
        'features+pixels': {'observation', *pictures, *goals},
    }
    for mode, names in expected.items():
        env = fetch_composer.load(task_name, seed=0, observation_mode=mode, pixels=_PIXELS)
        assert set(env.observation_spec()) == names
        for time_step in episodes.run(env, episodes.uniform_actions(2)):
            assert set(time_step.observation) == names
            for name in names & pictures:
                picture = time_step.observation[name]
                assert picture.shape == (24, 32, 3)
                assert picture.dtype == np.uint8
                assert picture.std() > 5
        env.close()


def test_pictures_change_nothing_else():
    plain = fetch_composer.load('push', seed=0)
    seeing = fetch_composer.load('push', seed=0, observation_mode='features+pixels', pixels=_PIXELS)
    actions = episodes.uniform_actions(12)
    for one, other in zip(episodes.run(plain, actions), episodes.run(seeing, actions), strict=True):
        for name, value in one.observation.items():
            np.testing.assert_array_equal(other.observation[name], value)


def test_pictures_show_the_state_they_come_with():
    env = fetch_composer.load('push', seed=0, observation_mode='pixels', pixels=_PIXELS)
    env.reset()
    time_step = env.step(np.ones(4, np.float32))
    no_shadow = {'shadow': False}
    again = env.physics.render(24, 32, camera_id='front', render_flag_overrides=no_shadow)
    assert np.abs(time_step.observation['front_rgb'].astype(int) - again.astype(int)).max() <= 2


def test_depth_and_segmentation():
    pixels = {'cameras': 'top', 'height': 48, 'width': 48, 'depth': True, 'segmentation': True}
    env = fetch_composer.load('slide', seed=0, observation_mode='pixels', pixels=pixels)
    observation = env.reset().observation
    depth = observation['top_depth']
    assert depth.shape == (48, 48, 1)
    # The camera hangs 1.75 m above the floor; the table's surface is at 0.4 m.
    assert np.median(depth) == pytest.approx(1.35, abs=0.05)
    segmentation = observation['top_segmentation']
    assert segmentation.shape == (48, 48, 2)
    table = env.physics.model.name2id('table/table', 'geom')
    assert (segmentation[..., 0] == table).mean() > 0.3


def test_gymnasium_gets_spaces_for_pictures():
    env = gym.make(
        'fetch_composer/FetchPush-v2',
        observation_mode='features+pixels',
        pixels={**_PIXELS, 'depth': True},
    )
    assert env.observation_space['front_rgb'] == gym.spaces.Box(0, 255, (24, 32, 3), np.uint8)
    assert env.observation_space['front_depth'].dtype == np.float32
    env_checker.check_env(env.unwrapped, skip_render_check=True)


def test_pictures_may_be_as_large_as_one_asks():
    pixels = {'cameras': 'front', 'height': np.int64(1000), 'width': 1400}
    env = fetch_composer.load('reach', seed=0, observation_mode='pixels', pixels=pixels)
    assert env.reset().observation['front_rgb'].shape == (1000, 1400, 3)
    env = gym.make('fetch_composer/FetchReach-v2', render_mode='rgb_array', width=1300, height=1000)
    env.reset(seed=0)
    assert env.render().shape == (1000, 1300, 3)


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'observation_mode': 'video'}, r'valid are features, pixels, features\+pixels'),
        ({'observation_mode': 'pixels', 'pixels': {'cameras': 'back'}}, 'valid are front, corner'),
        ({'pixels': {'size': 3}}, 'valid are cameras, height, width, depth, segmentation, shadows'),
        ({'pixels': {'height': 0}}, 'height of pixels must be a positive integer'),
        ({'pixels': {'height': True}}, 'height of pixels must be a positive integer'),
        ({'pixels': {'depth': 'no'}}, 'depth of pixels must be True or False'),
        ({'pixels': {'cameras': 'back'}}, 'valid are front, corner'),
        ({'pixels': True}, 'pixels must be a mapping'),
    ],
)
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        fetch_composer.load('push', **options)


@pytest.mark.parametrize('supersampling', [2, 16, 17, 20])
def test_a_pixel_is_the_mean_of_as_many_squared(supersampling):
    size = {'height': 12, 'width': 16, 'shadows': False}
    pictures = []
    for factor in (1, supersampling):
        pixels = {**size, 'supersampling': factor}
        env = fetch_composer.load('push', seed=0, observation_mode='pixels', pixels=pixels)
        pictures.append(env.reset().observation['corner_rgb'].astype(float))
    # Edges differ, and no more.
    assert abs(pictures[0].mean() - pictures[1].mean()) < 8
    assert np.median(np.abs(pictures[0] - pictures[1])) < 8
