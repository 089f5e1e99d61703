"""LeRobot: its own class reads a dataset, with pictures, and leads back into the environment.

LeRobot needs torch, and no process draws and has torch as well: a run does both, in two processes.
"""

import json
import subprocess
import sys

import numpy as np
import pytest

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import batch_rollout
from tests import datasets, runs

pytest.importorskip('lerobot', reason="LeRobot is not installed: pip install -e '.[lerobot]'")

from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402

pytestmark = pytest.mark.clients

_SEED, _EPISODES = 3, 2
_WIDTH, _HEIGHT = 96, 64


def _explore(folder, *flags, **variables):
    return subprocess.run(
        [
            sys.executable, runs.EXPLORE, '--policy=expert', f'--seed={_SEED}',
            f'--max_episode_steps={datasets.STEPS}', '--films=none', f'--width={_WIDTH}',
            f'--height={_HEIGHT}', '--dataset=lerobot:data', *flags,
        ],
        env=runs.environment(HF_HUB_OFFLINE='1', **variables),
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip


@pytest.fixture(scope='module')
def written(tmp_path_factory):
    """Returns the folder that a run has written into, and what it has printed."""
    folder = tmp_path_factory.mktemp('lerobot')
    result = _explore(folder, f'--episodes={_EPISODES}', '--noise=0.1')
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


@pytest.fixture(scope='module')
def dataset(written):
    """Returns the dataset as LeRobot reads it."""
    return LeRobotDataset('fetch_composer/data', root=written[0] / 'data', video_backend='pyav')


def _episodes():
    options = datasets.options('push', 'expert~0.1')
    return options, batch_rollout.run_episodes(options, range(_SEED, _SEED + _EPISODES))


def test_it_is_a_dataset_of_version_3_with_video_and_a_task_in_words(written, dataset):
    assert "LeRobotDataset('fetch_composer/data', root='data')" in written[1]
    info = json.loads((written[0] / 'data' / 'meta' / 'info.json').read_text())
    assert info['codebase_version'].startswith('v3') and info['robot_type'] == 'fetch'
    assert (dataset.fps, dataset.num_episodes) == (25, _EPISODES)
    assert len(dataset) == _EPISODES * datasets.STEPS
    frame = dataset[0]
    assert frame['task'] == 'push the block to the red mark'
    assert frame['observation.images.camera'].shape == (3, _HEIGHT, _WIDTH)
    assert frame['policy'] == 'expert~0.1'


def test_its_pictures_show_what_happens(dataset):
    first, last = (dataset[i]['observation.images.camera'].numpy() for i in (0, datasets.STEPS - 1))
    assert first.std() > 0.05 and np.abs(first - last).max() > 0.2


def test_its_numbers_lead_back_into_the_environment(dataset):
    options, episodes = _episodes()
    exact = dataset.hf_dataset.with_format(None)
    for number, episode in enumerate(episodes):
        rows = exact[number * datasets.STEPS : (number + 1) * datasets.STEPS]
        columns = {name: np.array(values) for name, values in rows.items()}
        assert set(columns['seed']) == {episode.seed}
        np.testing.assert_array_equal(columns['action'].astype(np.float32), episode.action)
        np.testing.assert_array_equal(columns['start'][0], episode.achieved_goal[0])
        np.testing.assert_array_equal(columns['goal'], episode.desired_goal[:-1])
        np.testing.assert_array_equal(columns['next.sparse_reward'], episode.reward)
        np.testing.assert_array_equal(columns['next.dense_reward'], -episode.distance[1:])
        np.testing.assert_array_equal(columns['next.success'], episode.distance[1:] < 0.05)
        assert columns['next.done'].tolist() == [False] * (datasets.STEPS - 1) + [True]
        datasets.assert_leads_back(
            options,
            episode.seed,
            columns['action'].astype(np.float32),
            columns['exact_observation'],
            columns['physics'],
            columns['gripper_pose'],
        )


def test_what_policies_learn_from_is_float32(dataset):
    frame = dataset[5]
    _, (episode, *_) = _episodes()
    both = np.concatenate([episode.observation[5], episode.desired_goal[5]]).astype(np.float32)
    np.testing.assert_array_equal(frame['observation.environment_state'].numpy(), both)
    assert frame['observation.state'].shape == (10,)


def test_it_is_kept_by_the_same_command_and_never_replaced_by_another(written):
    folder, _ = written
    path = folder / 'data' / 'meta' / 'info.json'
    before = path.stat().st_mtime_ns
    again = _explore(folder, f'--episodes={_EPISODES}', '--noise=0.1')
    assert again.returncode == 0 and path.stat().st_mtime_ns == before
    for flag in ('--noise=0.2', '--width=128'):
        other = _explore(folder, f'--episodes={_EPISODES}', '--noise=0.1', flag)
        assert other.returncode == 1 and 'which another run has written' in other.stderr
    assert path.stat().st_mtime_ns == before
    assert files.load_json(folder / 'data' / 'meta' / 'fetch_composer.json')['episodes'] == 2
    assert sorted(each.name for each in folder.iterdir()) == ['data', 'output']


def test_without_pictures_there_is_none(tmp_path):
    result = _explore(tmp_path, '--episodes=1', MUJOCO_GL='disabled')
    assert result.returncode == 1 and 'would have pictures' in result.stderr
    assert not list(tmp_path.iterdir())


def test_a_seed_that_its_integers_do_not_hold_is_refused(tmp_path):
    result = _explore(tmp_path, '--episodes=1', f'--seed={2**63}')
    assert result.returncode == 1 and 'seed must be at most' in result.stderr
