"""RL Baselines3 Zoo: its training script takes our settings as they are."""

import os
import pathlib
import subprocess
import sys

import pytest

pytest.importorskip('rl_zoo3', reason="RL Zoo is not installed: pip install -e '.[zoo]'")

import yaml  # noqa: E402

from fetch_composer import gymnasium_ids  # noqa: E402

pytestmark = pytest.mark.clients
_SETTINGS = pathlib.Path(__file__).parents[2] / 'examples' / 'rl_zoo.yml'


def test_there_are_settings_for_every_task_and_convention(task_name, convention):
    settings = yaml.safe_load(_SETTINGS.read_text(encoding='utf-8'))
    assert gymnasium_ids.env_id(task_name, convention) in settings


@pytest.mark.parametrize('env_id', ['FetchReach-v2', 'FetchReach-v4', 'FetchPush-v2'])
def test_the_training_script_trains(tmp_path, env_id):
    command = [
        sys.executable, '-m', 'rl_zoo3.train', '--algo=td3',
        f'--env=fetch_composer/{env_id}', '--gym-packages=fetch_composer',
        f'--conf-file={_SETTINGS}', '--n-timesteps=1200', '--eval-freq=-1', '--num-threads=1',
    ]  # fmt: skip
    subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, 'MUJOCO_GL': 'disabled'},
        check=True,
        stdout=subprocess.DEVNULL,
    )
    (model,) = tmp_path.glob(f'logs/td3/*{env_id}_1/*{env_id}.zip')
    assert model.stat().st_size > 100_000
