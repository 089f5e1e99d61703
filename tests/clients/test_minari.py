"""Minari: a run's episodes are read back, and replayed in the environment that they came from."""

import dataclasses
import os
import pathlib
import re
import signal
import subprocess
import sys
import warnings

import numpy as np
import pytest

from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.results import store
from fetch_composer.tasks import TaskOptions
from tests import datasets as saving
from tests import pages
from tests.test_resume import _options as _run_options
from tests.test_resume import _run, _run_stopped

minari = pytest.importorskip('minari', reason="Minari is not installed: pip install -e '.[minari]'")

from fetch_composer.explorer.datasets import formats, minari_format, part  # noqa: E402

pytestmark = pytest.mark.clients

_NAMES = {'push': 'Push', 'reach': 'Reach', 'slide': 'Slide', 'pick_and_place': 'PickAndPlace'}


@pytest.fixture(autouse=True)
def datasets(tmp_path, monkeypatch):
    """Returns the folder of Minari's datasets."""
    folder = tmp_path / 'datasets'
    monkeypatch.setenv('MINARI_DATASETS_PATH', str(folder))
    return folder


def _options(folder, **changes):
    return _run_options(folder, dataset='fetch/push-random-v0', **changes)


@pytest.mark.parametrize('reward_type', ['sparse', 'dense'])
def test_a_dataset_is_replayed_by_the_environment_it_recovers(task_name, convention, reward_type):
    options = saving.options(task_name, reward_type=reward_type, convention=convention)
    saving.save('replay-v3', options)
    dataset = minari.load_dataset('replay-v3')
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', DeprecationWarning)  # -v2 beside -v4.
        environment = dataset.recover_environment()
    dense = 'Dense' if reward_type == 'dense' else ''
    version = {'documented': 'v2', 'gymnasium_robotics': 'v4'}[convention]
    assert environment.spec.id == f'fetch_composer/Fetch{_NAMES[task_name]}{dense}-{version}'
    assert environment.spec.max_episode_steps == saving.STEPS
    assert dataset.action_space == environment.action_space
    assert dataset.observation_space == environment.observation_space

    stored = list(dataset.storage.get_episode_metadata(dataset.episode_indices))
    assert [each['seed'] for each in stored] == list(saving.SEEDS)
    for episode, metadata in zip(dataset.iterate_episodes(), stored, strict=True):
        assert episode.actions.dtype == np.float32 and len(episode.actions) == saving.STEPS
        observation, info = environment.reset(seed=metadata['seed'])
        np.testing.assert_array_equal(metadata['start'], episode.observations['achieved_goal'][0])
        np.testing.assert_array_equal(metadata['goal'], episode.observations['desired_goal'][0])
        assert metadata['policy'] == 'random'
        for step in range(saving.STEPS + 1):
            for name, value in observation.items():
                np.testing.assert_allclose(
                    episode.observations[name][step], value, rtol=0, atol=1e-9, err_msg=name
                )
            assert episode.infos['is_success'][step] == info['is_success']
            if step < saving.STEPS:
                observation, reward, terminated, truncated, info = environment.step(
                    episode.actions[step]
                )
                assert episode.rewards[step] == pytest.approx(reward, abs=1e-9)
                stored_reward = episode.infos[f'{reward_type}_reward'][step + 1]
                assert stored_reward == pytest.approx(reward, abs=1e-9)
                assert episode.terminations[step] == terminated
                assert episode.truncations[step] == truncated
    environment.close()


def test_the_state_of_any_step_leads_back_into_the_environment(task_name, convention):
    options = saving.options(task_name, convention=convention)
    saving.save('states-v0', options, [5])
    (episode,) = minari.load_dataset('states-v0').iterate_episodes()
    saving.assert_leads_back(
        options,
        5,
        episode.actions,
        episode.observations['observation'],
        episode.infos['physics'],
        episode.infos['gripper_pose'],
    )


def test_the_page_s_code_leads_back_to_a_start_and_into_the_middle_of_an_episode():
    (found, *_) = saving.save('fetch/push-expert-v0', saving.options(max_episode_steps=25))
    namespace: dict = {}
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # -v2 beside -v4.
        from_seed, from_state = pages.codes_of('datasets.md')
        exec(from_seed, namespace)
        for name, value in namespace['observation'].items():
            np.testing.assert_allclose(value, getattr(found, name)[0], rtol=0, atol=1e-9)
        exec(from_state, namespace)
    observation, *_ = namespace['after']
    np.testing.assert_allclose(observation['observation'], found.observation[21], rtol=0, atol=1e-9)


def test_a_run_writes_its_dataset_once_it_is_finished(tmp_path, datasets):
    options = _options(tmp_path)
    stopped = _run_stopped(options, after=4)
    assert stopped.stopped_by == signal.SIGTERM
    assert list(minari.list_local_datasets()) == []
    assert _run(options).continued == 4
    dataset = minari.load_dataset(options.dataset)
    assert dataset.total_episodes == 7 and dataset.total_steps == 7 * 4
    assert dataset.storage.metadata['algorithm_name'] == 'random'
    assert list(minari.list_local_datasets()) == [options.dataset]
    assert [path.name for path in datasets.iterdir()] == ['fetch']
    # Another one in the same namespace.
    _run(dataclasses.replace(options, dataset='fetch/other-v0'))
    assert len(minari.list_local_datasets()) == 2


def test_a_dataset_that_cannot_be_written_whole_is_not_there(datasets, monkeypatch):

    def fail(*unused):
        raise OSError('disk full')

    monkeypatch.setattr(minari_format, '_buffer', fail)
    with pytest.raises(OSError, match='disk full'):
        saving.save('reach-v0', saving.options('reach', 'zero', max_episode_steps=2))
    assert list(datasets.iterdir()) == []


def test_what_a_killed_run_has_half_written_is_removed_by_the_next(tmp_path, datasets, monkeypatch):
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        # A process that is killed does not come to remove anything.
        patched.setattr(part.shutil, 'rmtree', lambda *args, **kwargs: None)
        patched.setattr(minari_format, '_buffer', _interrupt)
        _run(_options(tmp_path))
    (half,) = datasets.glob('.fetch_composer_[!p]*')
    stranger = datasets / '.fetch_composer_of_another_run'
    stranger.mkdir()
    assert _run(_options(tmp_path)).continued == 7
    assert not half.exists() and stranger.exists()
    assert list(minari.list_local_datasets()) == ['fetch/push-random-v0']


def _interrupt(*unused):
    raise KeyboardInterrupt


def test_a_dataset_that_is_there_is_refused_before_anything_is_run(tmp_path):
    options = _options(tmp_path / 'first')
    _run(options)
    options = dataclasses.replace(options, output_dir=str(tmp_path / 'second'), seed=4)
    with pytest.raises(ValueError, match='There is a dataset in .*push-random-v0 already'):
        _run(options)
    assert not options.folder.exists()


@pytest.mark.parametrize('name', ['', 'push', 'push-v', 'push v0', '/push-v0', '../push-v0'])
def test_what_cannot_be_a_name_is_refused(name):
    with pytest.raises(ValueError, match=r'must have the form \[namespace/\]name-v0'):
        formats.dataset(f'minari:{name}')


def test_a_namespace_that_a_killed_run_has_not_made_is_made_by_the_next(tmp_path, datasets):
    options = _options(tmp_path)
    _run(options)
    (datasets / 'fetch' / 'namespace_metadata.json').unlink()
    before = (datasets / 'fetch' / 'push-random-v0' / 'data' / 'main_data.hdf5').stat().st_mtime_ns
    _run(options)
    assert (datasets / 'fetch' / 'namespace_metadata.json').exists()
    after = (datasets / 'fetch' / 'push-random-v0' / 'data' / 'main_data.hdf5').stat().st_mtime_ns
    assert after == before


def test_a_run_killed_right_after_its_dataset_ends_with_the_same_command(tmp_path, monkeypatch):
    options = _options(tmp_path)
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(store.Store, 'discard', _interrupt)
        _run(options)
    assert (tmp_path / store.NAME).exists()
    assert _run(options).continued == 7
    assert not (tmp_path / store.NAME).exists()
    assert list(minari.list_local_datasets()) == [options.dataset]


def test_given_places_are_the_recovered_environments_own():
    given = TaskOptions(object_position=(1.3, 0.9), goal=(1.2, 0.6, 0.4), max_episode_steps=2)
    saving.save('push-v0', batch_rollout.EpisodeOptions('push', 'zero', given), [0])
    dataset = minari.load_dataset('push-v0')
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', DeprecationWarning)  # -v2 beside -v4.
        observation, _ = dataset.recover_environment().reset(seed=8)
    np.testing.assert_allclose(observation['achieved_goal'][:2], given.object_position, atol=1e-9)
    np.testing.assert_allclose(observation['desired_goal'], given.goal)


def test_a_task_of_ones_own_has_a_dataset_that_its_module_reads_back(tmp_path):
    (tmp_path / 'gate.py').write_text(pages.code_of('new_task.md'))
    command = (
        '-m', 'fetch_composer.explorer', '--import=gate', '--task=push_through_gate',
        '--policy=random', '--episodes=2', '--max_episode_steps=3', '--dataset=gate-v0',
    )  # fmt: skip
    recover = (
        'import gate, minari\n'
        'environment = minari.load_dataset("gate-v0").recover_environment()\n'
        'environment.reset(seed=0)\n'
        'print(environment.spec.id, environment.spec.max_episode_steps)'
    )
    environment = {
        **os.environ,
        'MUJOCO_GL': 'disabled',
        'PYTHONPATH': str(pathlib.Path(__file__).parents[2]),
    }
    for arguments in (command, ('-W', 'ignore', '-c', recover)):
        result = subprocess.run(
            [sys.executable, *arguments],
            env=environment, cwd=tmp_path, capture_output=True, text=True,
        )  # fmt: skip
        assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == 'fetch_composer/FetchPushThroughGate-v0 3'


def test_reading_a_dataset_back_needs_no_import_of_ours():
    saving.save('reach-v0', saving.options('reach', 'zero', max_episode_steps=2), [0])
    code = 'import minari; minari.load_dataset("reach-v0").recover_environment().reset(seed=0)'
    subprocess.run([sys.executable, '-W', 'ignore', '-c', code], check=True)


def test_episodes_that_end_at_their_goals_are_terminated():
    options = saving.options(terminate_on_success=True, max_episode_steps=3)
    found = saving.save('push-v0', options, range(12))
    assert {each.steps for each in found} == {1, 3}
    dataset = minari.load_dataset('push-v0')
    for one, episode in zip(dataset.iterate_episodes(), found, strict=True):
        last = episode.steps - 1
        assert one.terminations.tolist() == [False] * last + [episode.is_success]
        assert one.truncations.tolist() == [False] * last + [episode.steps == 3]
    environment = dataset.recover_environment()
    assert environment.unwrapped.dm_env.task.options.terminate_on_success
    environment.close()


def test_the_example_clones_the_policy_of_a_dataset(run_example):
    pytest.importorskip('jax', reason="JAX is not installed: pip install -e '.[learn]'")
    saving.save('fetch/reach-expert-v0', saving.options('reach', 'expert'), range(60))
    out = run_example(
        'behaviour_cloning.py', '--dataset=fetch/reach-expert-v0', '--updates=1000', '--seed=1'
    )
    success = re.search(r'policy.onnx: success ([\d.]+) of 100 episodes', out)
    assert success is not None and float(success[1]) >= 0.95, out
