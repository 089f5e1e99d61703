"""Datasets of every format that needs no library: what is in them, and what becomes of others."""

import json
import os
import pathlib
import signal
import subprocess
import sys

import numpy as np
import pytest

from benchmarks import markdown
from docs import make_datasets
from fetch_composer import policies, tasks
from fetch_composer.explorer import files
from fetch_composer.explorer.datasets import formats, ogbench_format, part
from fetch_composer.explorer.datasets import writing as dataset_writing
from fetch_composer.explorer.episodes import batch_rollout, provenance, replay
from fetch_composer.explorer.results import store
from tests import datasets, runs
from tests.test_resume import _options as _run_options
from tests.test_resume import _run

_MIXTURE = 'expert:0.5,random:0.5'


def _arrays(path):
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def _target(folder):
    return f'ogbench:{folder}/push.npz'


def _names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_an_episode_leads_back_into_the_environment(tmp_path, task_name, convention):
    reward_type = 'dense' if task_name == 'reach' else 'sparse'
    options = datasets.options(task_name, convention=convention, reward_type=reward_type)
    datasets.save(f'ogbench:{tmp_path}/a.npz', options, seeds=(11, 5))
    for name, seed in (('a.npz', 11), ('a-val.npz', 5)):
        arrays = _arrays(tmp_path / name)
        assert arrays['episode_seed'].tolist() == [seed]
        assert arrays['episode_steps'].tolist() == [datasets.STEPS]
        datasets.assert_leads_back(
            options,
            seed,
            arrays['actions'][:-1],
            arrays['observations'],
            arrays['physics'],
            arrays['gripper_pose'],
        )
        achieved, goal = arrays['achieved_goals'], arrays['desired_goals']
        np.testing.assert_array_equal(arrays['episode_start'][0], achieved[0])
        np.testing.assert_array_equal(arrays['episode_goal'][0], goal[0])
        assert arrays['terminals'].tolist() == [0] * datasets.STEPS + [1]
        np.testing.assert_array_equal(arrays['successes'], tasks.is_success(achieved, goal))
        np.testing.assert_array_equal(arrays['masks'][:-1], 1 - arrays['successes'][1:])
        for kind in ('sparse', 'dense'):
            expected = tasks.compute_reward(achieved[1:], goal[1:], kind)
            np.testing.assert_array_equal(arrays[f'{kind}_rewards'][:-1], expected)
        np.testing.assert_allclose(
            arrays['rewards'], arrays[f'{reward_type}_rewards'], rtol=0, atol=1e-12
        )


def test_every_tenth_episode_is_for_validation_and_each_has_its_policy(tmp_path):
    options = datasets.options('reach', _MIXTURE, max_episode_steps=2)
    datasets.save(_target(tmp_path), options, range(21))
    train, validation = _arrays(tmp_path / 'push.npz'), _arrays(tmp_path / 'push-val.npz')
    assert validation['episode_seed'].tolist() == [9, 19]
    assert sorted({*train['episode_seed'], 9, 19}) == list(range(21))
    for arrays in (train, validation):
        played = [policies.player(_MIXTURE, seed) for seed in arrays['episode_seed'].tolist()]
        assert arrays['episode_policy'].tolist() == played
        assert len(arrays['actions']) == len(arrays['observations']) == 3 * len(played)


def test_episodes_that_end_at_their_goals_have_their_own_lengths(tmp_path):
    options = datasets.options(terminate_on_success=True, max_episode_steps=3)
    found = datasets.save(_target(tmp_path), options, range(12))
    assert {each.steps for each in found} == {1, 3}
    arrays = _arrays(tmp_path / 'push.npz')
    ends = np.flatnonzero(arrays['terminals'])
    np.testing.assert_array_equal(np.diff(ends, prepend=-1), arrays['episode_steps'] + 1)
    of_seed = {each.seed: each for each in found}
    for end, seed in zip(ends, arrays['episode_seed'].tolist(), strict=True):
        np.testing.assert_array_equal(arrays['observations'][end], of_seed[seed].observation[-1])


def test_a_dataset_says_what_decides_on_its_episodes(tmp_path):
    _run(
        _run_options(tmp_path / 'run', dataset=_target(tmp_path), noise=0.1, goal=(1.3, 0.8, 0.42))
    )
    about = json.loads(str(_arrays(tmp_path / 'push.npz')['about']))
    assert about['versions'] == provenance.versions() and about['code'] == provenance.code_digest()
    assert about['policies'] == [['random~0.1', None]] and about['goal'] == [1.3, 0.8, 0.42]
    assert (about['task'], about['first_seed'], about['episodes']) == ('push', 3, 7)


# -- What is there already -------------------------------------------------------------------------


def test_what_another_run_or_program_has_written_is_never_replaced(tmp_path):
    options = _run_options(tmp_path / 'run', dataset=_target(tmp_path))
    for name in ('push.npz', 'push-val.npz'):
        (tmp_path / name).write_text('of someone else')
        with pytest.raises(ValueError, match='push.npz already, which another run has written'):
            _run(options)
        assert not options.folder.exists()
        (tmp_path / name).unlink()
    _run(options)
    before = (tmp_path / 'push.npz').read_bytes()
    for changes in ({'seed': 4}, {'reward_type': 'dense'}, {'policy': ['zero']}):
        with pytest.raises(ValueError, match='which another run has written'):
            _run(_run_options(tmp_path / 'other', dataset=_target(tmp_path), **changes))
    assert (tmp_path / 'push.npz').read_bytes() == before
    assert _names(tmp_path) == ['push-val.npz', 'push.npz', 'run']


def test_a_run_killed_right_after_its_dataset_ends_with_the_same_command(tmp_path, monkeypatch):
    options = _run_options(tmp_path / 'run', dataset=_target(tmp_path))
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(store.Store, 'discard', _interrupt)
        _run(options)
    assert (options.folder / store.NAME).exists()
    before = (tmp_path / 'push.npz').stat().st_mtime_ns
    assert _run(options).continued == 7
    assert (tmp_path / 'push.npz').stat().st_mtime_ns == before
    assert not (options.folder / store.NAME).exists()
    # And one between the two files.
    expected = _arrays(tmp_path / 'push-val.npz')
    (tmp_path / 'push-val.npz').unlink()
    _run(options)
    for name, array in _arrays(tmp_path / 'push-val.npz').items():
        np.testing.assert_array_equal(array, expected[name])


def _interrupt(*unused):
    raise KeyboardInterrupt


def test_a_killed_run_leaves_nothing_under_the_name_and_the_next_removes_the_rest(
    tmp_path, monkeypatch
):
    options = _run_options(tmp_path / 'run', dataset=_target(tmp_path))
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        # A process that is killed does not come to remove anything.
        patched.setattr(part.shutil, 'rmtree', lambda *_, **__: None)
        patched.setattr(ogbench_format.files, 'save_arrays', _save_data_only)
        _run(options)
    (half,) = tmp_path.glob('.fetch_composer_[!p]*')
    assert not list(tmp_path.glob('push*'))
    assert _run(options).continued == 7
    assert not half.exists() and (tmp_path / 'push-val.npz').exists()


_save_arrays = ogbench_format.files.save_arrays


def _save_data_only(path, *args, **kwargs):
    _save_arrays(path, *args, **kwargs)
    if path.name == 'push.npz':
        raise KeyboardInterrupt


def test_a_signal_while_a_dataset_is_written_loses_nothing(tmp_path, monkeypatch):
    options = _run_options(tmp_path / 'run', dataset=_target(tmp_path))
    write = dataset_writing.write

    def write_signalled(*args):
        signal.raise_signal(signal.SIGTERM)
        write(*args)

    with monkeypatch.context() as patched:
        patched.setattr(dataset_writing, 'write', write_signalled)
        assert _run(options).stopped_by == signal.SIGTERM
    assert _names(tmp_path) == ['run'] and (options.folder / 'summary.json').exists()
    again = _run(options)
    assert again.continued == 7 and again.stopped_by is None
    assert _names(tmp_path) == ['push-val.npz', 'push.npz', 'run']


def test_a_dataset_of_what_cannot_be_replayed_is_not_there(tmp_path, monkeypatch):
    options = datasets.options()
    episodes = batch_rollout.run_episodes(options, [0, 1])
    episodes[1].action[3] += 0.5
    monkeypatch.setattr(batch_rollout, 'run_episodes', lambda *_: episodes)
    with pytest.raises(replay.ReplayError, match='seed 1 was played again and ended elsewhere'):
        datasets.save(_target(tmp_path), options)
    assert not _names(tmp_path)


# -- What cannot be --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('target', 'message'),
    [
        (
            'zarr:push',
            "Unknown dataset 'zarr:push'; valid are minari:NAME, ogbench:PATH.npz, lerobot:DIR, "
            'and NAME of minari',
        ),
        (':push', "Unknown dataset ':push'; valid are minari:NAME"),
        ('ogbench:push', r'must have the form ogbench:PATH.npz; got .push'),
        ('ogbench:', r'must have the form ogbench:PATH.npz'),
        ('ogbench:folder/.npz', r'must have the form ogbench:PATH.npz'),
    ],
)
def test_what_names_no_dataset_is_refused_with_what_would(target, message):
    with pytest.raises(ValueError, match=message):
        formats.dataset(target)


def test_a_dataset_is_of_one_policy_and_of_enough_episodes(tmp_path):
    several = _run_options(tmp_path / 'a', dataset=_target(tmp_path), policy=['random', 'zero'])
    with pytest.raises(ValueError, match='dataset is of one policy'):
        _run(several)
    with pytest.raises(ValueError, match='episodes must be at least 2'):
        _run(_run_options(tmp_path / 'b', dataset=_target(tmp_path), episodes=1))
    assert not _names(tmp_path)


def test_a_folder_that_cannot_be_written_into_is_named(tmp_path):
    (tmp_path / 'file').write_text('')
    options = _run_options(tmp_path / 'a', dataset=f'ogbench:{tmp_path}/file/push.npz')
    with pytest.raises(ValueError, match='No dataset can be written: .*file'):
        _run(options)


def test_the_command_says_what_reads_the_dataset(tmp_path):
    environment = {**os.environ, 'MUJOCO_GL': 'disabled', 'PYTHONPATH': str(runs.ROOT)}
    result = subprocess.run(
        [sys.executable, runs.EXPLORE, '--policy=random', '--episodes=3', '--max_episode_steps=4',
         '--dataset=ogbench:push.npz'],
        env=environment, cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "ogbench.utils.load_dataset('push.npz')" in result.stdout
    assert pathlib.Path(tmp_path, 'push-val.npz').exists()


# -- The card --------------------------------------------------------------------------------------


def test_the_card_has_what_was_made_once_and_says_what_was_not(tmp_path, monkeypatch):
    commands = []

    def run(command, check):
        assert check
        commands.append(command)
        flags = dict(each.removeprefix('--').split('=', 1) for each in command[3:])
        folder = pathlib.Path(flags['output_dir'])
        files.prepare_folder(folder)
        origin = {'versions': provenance.versions(), 'code': provenance.code_digest()}
        figures = {'success_rate': 0.5, 'success_interval': [0.469, 0.531], 'return': {'mean': -30}}
        first = int(flags['seed'])
        played = {'episodes': [{'seed': first}, {'seed': first + 999}]}
        files.save_json(folder / 'summary.json', {**origin, **figures, **played})
        path = pathlib.Path(flags['dataset'].removeprefix('ogbench:'))
        for name in (path, path.with_name(f'{path.stem}-val.npz')):
            name.write_bytes(bytes(1_500_000))

    monkeypatch.setattr(make_datasets.subprocess, 'run', run)
    page = tmp_path / 'page.md'
    page.write_text(f'<!-- {make_datasets.TABLE} -->\n<!-- end -->\n')
    words = ['--format=ogbench', f'--runs={tmp_path}', f'--page={page}', '--tasks', 'push']
    for _ in range(2):  # The second time, all are there.
        make_datasets.main(make_datasets.parser.parse_args(words))
    assert len(commands) == len(make_datasets.KINDS)
    rows = {row[0]: row for row in markdown.rows(page, f'| {make_datasets.HEADER[0]} |')}
    assert len(rows) == 7 * len(make_datasets.KINDS)
    made = rows[f'`ogbench:{tmp_path}/push-noisy.npz`']
    assert made[1:] == ['2000–2999', '50.0 (46.9–53.1)', '-30.0', '3']
    assert '| noisy | `--policy=expert --noise=0.2` |' in page.read_text()
    assert sum('not measured yet' in row for row in rows.values()) == 6 * len(make_datasets.KINDS)


def test_actions_of_any_precision_lead_back_into_the_environment(tmp_path, monkeypatch):
    (tmp_path / 'precise.py').write_text(
        'import numpy as np\n'
        'def act(observation):\n'
        "    way = observation['desired_goal'] - observation['achieved_goal']\n"
        '    return np.append(way / 0.05, 0)\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    options = datasets.options('reach', 'precise:act')
    datasets.save(f'ogbench:{tmp_path}/a.npz', options, seeds=(11, 5))
    arrays = _arrays(tmp_path / 'a.npz')
    assert np.abs(arrays['actions']).max() <= 1
    datasets.assert_leads_back(
        options,
        11,
        arrays['actions'][:-1],
        arrays['observations'],
        arrays['physics'],
        arrays['gripper_pose'],
    )
