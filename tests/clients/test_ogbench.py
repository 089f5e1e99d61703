"""OGBench: its own loader reads a dataset, whose transitions are those of the environment."""

import numpy as np
import pytest

from tests import datasets

pytest.importorskip('ogbench', reason="OGBench is not installed: pip install -e '.[ogbench]'")

from ogbench import utils  # noqa: E402

pytestmark = pytest.mark.clients

_SEEDS = range(4)


def _loaded(path, **kwargs):
    return utils.load_dataset(str(path), ob_dtype=np.float64, **kwargs)


def test_its_loader_gives_the_transitions_and_none_between_episodes(
    tmp_path, task_name, convention
):
    options = datasets.options(task_name, convention=convention)
    episodes = datasets.save(f'ogbench:{tmp_path}/data.npz', options, _SEEDS)
    for path, expected in (
        (tmp_path / 'data.npz', episodes[:3]), (tmp_path / 'data-val.npz', episodes[3:])
    ):  # fmt: skip
        loaded = _loaded(path)
        for name, part in (
            ('observations', [each.observation[:-1] for each in expected]),
            ('next_observations', [each.observation[1:] for each in expected]),
            ('actions', [each.action for each in expected]),
        ):
            np.testing.assert_array_equal(loaded[name], np.concatenate(part))
        ends = np.arange(1, len(expected) + 1) * datasets.STEPS - 1
        np.testing.assert_array_equal(np.flatnonzero(loaded['terminals']), ends)


def test_what_it_reads_leads_back_into_the_environment(tmp_path):
    options = datasets.options('pick_and_place')
    datasets.save(f'ogbench:{tmp_path}/data.npz', options, _SEEDS)
    loaded = _loaded(tmp_path / 'data-val.npz', add_info=True, compact_dataset=True)
    with np.load(tmp_path / 'data-val.npz') as file:
        datasets.assert_leads_back(
            options,
            int(file['episode_seed'][0]),
            loaded['actions'][:-1],
            loaded['observations'],
            file['physics'],
            file['gripper_pose'],
        )
        # The time, then positions and velocities.
        both = np.concatenate([loaded['qpos'], loaded['qvel']], axis=1)
        np.testing.assert_array_equal(both, file['physics'][:, 1 : both.shape[1] + 1])


def test_it_finds_both_parts_by_the_path_of_one(tmp_path):
    datasets.save(f'ogbench:{tmp_path}/data.npz', datasets.options(), _SEEDS)
    train, validation = utils.make_env_and_datasets(
        'fetch-play-v0', dataset_path=str(tmp_path / 'data.npz'), dataset_only=True
    )
    assert len(train['observations']) == 3 * len(validation['observations'])
    assert train['observations'].dtype == np.float32
