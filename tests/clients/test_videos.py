"""Films that libraries take of the native batch: SB3's recorder, and Gymnasium's for vectors."""

import os
import subprocess
import sys

import imageio.v2 as imageio
import pytest

pytest.importorskip('moviepy', reason="MoviePy is not installed: pip install -e '.[sb3]'")
pytest.importorskip(
    'stable_baselines3', reason="Stable-Baselines3 is not installed: pip install -e '.[sb3]'"
)

pytestmark = pytest.mark.clients

_MAKE = """
import torch._dynamo  # Before the first picture: see docs/clients.md.
import sys
import gymnasium as gym
import numpy as np
import fetch_composer

envs = gym.make_vec(
    'fetch_composer/FetchPush-v4', num_envs=6, render_mode='rgb_array', width=96, height=64,
    max_episode_steps=10, {arguments}
)
"""
_SB3 = """
from stable_baselines3.common.vec_env import VecVideoRecorder
from fetch_composer.interfaces.sb3_vec_env import SB3VecEnv

envs = VecVideoRecorder(SB3VecEnv(envs), sys.argv[1], lambda step: step == 0, video_length=12)
envs.reset()
for _ in range(14):
    envs.step(np.ones((6, 4), np.float32))
envs.close()
"""
_GYMNASIUM = """
from gymnasium.wrappers.vector import RecordVideo

envs = RecordVideo(envs, sys.argv[1], video_aspect_ratio=(3, 2), episode_trigger=lambda _: True)
envs.reset(seed=0)
for _ in range(12):
    envs.step(np.ones((6, 4), np.float32))
envs.close()
"""


@pytest.mark.parametrize(
    ('arguments', 'code', 'frames', 'shape'),
    [
        ('render_ids=[0, 2, 3, 5]', _SB3, 13, (128, 192, 3)),
        ('', _GYMNASIUM, 10, (128, 288, 3)),
    ],
    ids=['VecVideoRecorder, of four', 'RecordVideo, of all'],
)
def test_a_film_shows_environments_side_by_side(tmp_path, arguments, code, frames, shape):
    result = subprocess.run(
        [sys.executable, '-c', _MAKE.format(arguments=arguments) + code, str(tmp_path)],
        env={**os.environ, 'MUJOCO_GL': 'egl'},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    first = min(tmp_path.glob('*.mp4'))
    pictures = imageio.mimread(first, 'ffmpeg')
    assert frames - 1 <= len(pictures) <= frames, 'MoviePy rounds, and may drop the last'
    assert pictures[0].shape == shape
    assert abs(pictures[0].astype(int) - pictures[-1]).mean() > 1
    with imageio.get_reader(first, 'ffmpeg') as film:
        assert film.get_meta_data()['fps'] == 25
