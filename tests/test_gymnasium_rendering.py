"""The Gymnasium face: pictures, cameras and the window."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import env_checker

from fetch_composer.interfaces import gymnasium_env

pytestmark = pytest.mark.filterwarnings('ignore:.*out of date.*:DeprecationWarning')


@pytest.mark.parametrize('mode', ['rgb_array', 'depth_array'])
def test_pictures_have_their_size_and_show_something(mode):
    env = gym.make(
        'fetch_composer/FetchPush-v2', render_mode=mode, width=96, height=64, camera_name='front'
    )
    env.reset(seed=0)
    picture = env_checker.env_render_passive_checker(env.unwrapped)
    assert picture.shape == ((64, 96, 3) if mode == 'rgb_array' else (64, 96))
    assert picture.dtype == (np.uint8 if mode == 'rgb_array' else np.float32)
    assert picture.std() > 0.1
    env.close()
    env.close()


def test_unknown_cameras_and_modes_are_answered_with_the_valid_ones():
    with pytest.raises(ValueError, match='valid are front, corner'):
        gym.make('fetch_composer/FetchPush-v2', camera_name='back')
    with pytest.raises(ValueError, match='valid are human, rgb_array, depth_array'):
        gymnasium_env.FetchEnv('push', render_mode='ascii')


def test_a_window_without_a_display_is_refused_with_a_way_out():
    script = (
        'import gymnasium as gym, fetch_composer\n'
        "env = gym.make('fetch_composer/FetchPush-v4', render_mode='human')\n"
        'try:\n    env.reset(seed=0)\nexcept RuntimeError as error:\n    print(error)\n'
    )
    result = subprocess.run(
        [sys.executable, '-c', script],
        capture_output=True,
        text=True,
        check=True,
        env={'PATH': '', 'MUJOCO_GL': 'disabled'},
    )
    assert 'rgb_array' in result.stdout


def test_a_window_shows_an_episode_in_real_time(monkeypatch):
    """The clock is a stand-in, and so is the window: this machine may have none."""

    class Window:
        def sync(self):
            pass

        def close(self):
            pass

    env = gymnasium_env.FetchEnv('push')
    env.reset(seed=0)
    env.render_mode, env._viewer, env._viewer_threads = 'human', Window(), set()
    clock = [100.0]
    monkeypatch.setattr(gymnasium_env.time, 'perf_counter', lambda: clock[0])
    monkeypatch.setattr(
        gymnasium_env.time, 'sleep', lambda seconds: clock.__setitem__(0, clock[0] + seconds)
    )
    for _ in range(26):
        env.step(np.zeros(4, np.float32))
    assert clock[0] - 100 == pytest.approx(1.0)
    env.close()
