"""explore.py and the files that it writes, driven as a user drives it."""

import json
import shlex
import signal
import subprocess
import sys
import time

import imageio.v2 as imageio
import numpy as np
import pytest

import fetch_composer
from fetch_composer import tasks
from fetch_composer.explorer import files, flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.pictures import contact_sheet
from tests import pages, runs

# -- A whole run, with pictures --------------------------------------------------------------------


@pytest.fixture(scope='module')
def filmed(tmp_path_factory):
    """Returns the folder and the standard output of a short run."""
    folder = tmp_path_factory.mktemp('explore') / 'new' / 'folder'
    result = runs.explore(
        f'--episodes={runs.EPISODES}', f'--max_episode_steps={runs.STEPS}', f'--seed={runs.SEED}',
        '--reward_type=dense', '--fps=20', f'--output_dir={folder}', *runs.SMALL,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert 'Traceback' not in result.stderr
    if runs.summary(folder)['gl_backend'] is None:
        pytest.skip('no OpenGL backend works here')
    return folder, result.stdout


def test_run_writes_what_it_says_and_nothing_else(filmed):
    folder, _ = filmed
    films = {'contact_sheet.png', 'episode_000.mp4', 'episode_001.mp4'}
    expected = {'replay.html', *films, *runs.PLAIN_FILES}
    assert runs.names(folder) == expected
    assert set(runs.summary(folder)['files']) == expected


def test_run_ends_by_saying_what_to_open(filmed):
    folder, stdout = filmed
    assert str(folder) in stdout
    for name in runs.names(folder):
        assert name in stdout


def test_films_have_a_frame_for_every_step_and_the_reset(filmed):
    folder, _ = filmed
    for index in range(runs.EPISODES):
        with imageio.get_reader(folder / f'episode_{index:03d}.mp4') as film:
            frames = [np.asarray(frame) for frame in film]
            assert film.get_meta_data()['fps'] == 20
        assert len(frames) == runs.STEPS + 1
        assert all(frame.shape == (64, 96, 3) for frame in frames)
        assert all(frame.std() > 10 for frame in frames)  # A scene, not a blank.
        assert np.abs(frames[0].astype(int) - frames[-1]).mean() > 1  # The arm has moved.


def test_pictures_open(filmed):
    folder, _ = filmed
    sheet = imageio.imread(folder / 'contact_sheet.png')
    plot = imageio.imread(folder / 'progress.png')
    assert sheet.shape[0] > runs.EPISODES * 150
    assert plot.shape[0] > 600
    assert sheet.std() > 10 and plot.std() > 10


def test_trajectories_are_those_of_the_environment(filmed):
    folder, _ = filmed
    with np.load(folder / 'trajectories.npz') as file:
        saved = dict(file)
    assert saved['observation'].shape == (runs.EPISODES, runs.STEPS + 1, 25)
    assert saved['achieved_goal'].shape == (runs.EPISODES, runs.STEPS + 1, 3)
    assert saved['desired_goal'].shape == (runs.EPISODES, runs.STEPS + 1, 3)
    assert saved['distance'].shape == (runs.EPISODES, runs.STEPS + 1)
    assert saved['action'].shape == (runs.EPISODES, runs.STEPS, 4)
    assert saved['action'].dtype == np.float32
    assert saved['seed'].tolist() == [runs.SEED, runs.SEED + 1]

    for index, seed in enumerate(saved['seed'].tolist()):
        env = fetch_composer.load('push', seed=seed, reward_type='dense')
        time_step = env.reset()
        for step, action in enumerate(saved['action'][index]):
            for name, value in time_step.observation.items():
                np.testing.assert_allclose(saved[name][index, step], value, rtol=0, atol=1e-9)
            time_step = env.step(action)
            assert saved['reward'][index, step] == pytest.approx(time_step.reward, abs=1e-9)


def test_summary_tells_what_the_trajectories_hold(filmed):
    folder, _ = filmed
    summary = runs.summary(folder)
    with np.load(folder / 'trajectories.npz') as file:
        saved = dict(file)
    assert summary['episodes_finished'] == runs.EPISODES
    assert summary['stopped_by'] is None
    assert summary['flags']['seed'] == runs.SEED
    assert summary['flags']['reward_type'] == 'dense'
    assert summary['versions']['mujoco']
    assert summary['control_steps_per_second'] > 0
    assert summary['success_rate'] == np.mean(saved['distance'][:, -1] < 0.05)
    assert summary['return']['mean'] == pytest.approx(saved['reward'].sum(axis=1).mean())
    assert summary['final_distance_m']['max'] == pytest.approx(saved['distance'][:, -1].max())
    for index, episode in enumerate(summary['episodes']):
        assert episode['seed'] == saved['seed'][index]
        assert episode['is_success'] == saved['is_success'][index]


# -- Interruption ----------------------------------------------------------------------------------


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_keeps_the_finished_episodes_and_says_so(tmp_path, number):
    process = subprocess.Popen(
        [
            sys.executable, runs.EXPLORE, '--episodes=5000', '--max_episode_steps=5',
            '--num_envs=4',
            f'--output_dir={tmp_path}', *runs.SMALL,
        ],
        env=runs.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + runs.SECONDS_TO_START
    while time.monotonic() < deadline and process.poll() is None:
        if len(list(tmp_path.glob('.unfinished_run/1_expert/episodes*.npz'))) > 1:
            break
        time.sleep(0.05)
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=runs.SECONDS_TO_START)

    assert process.returncode == 128 + number, stderr
    assert f'Stopped by {number.name}' in stdout
    assert 'The same command continues.' in stdout
    assert 'Traceback' not in stderr
    summary = runs.summary(tmp_path)
    finished = summary['episodes_finished']
    assert 8 <= finished < 5000
    assert summary['stopped_by'] == number.name
    assert runs.names(tmp_path) == {'.unfinished_run', *runs.PLAIN_FILES}
    with np.load(tmp_path / 'trajectories.npz') as file:
        assert file['reward'].shape == (finished, 5)


def test_an_interruption_before_the_first_episode_leaves_earlier_files_alone(tmp_path):
    run = run_lib.Run(runs.options(output_dir=str(tmp_path), max_episode_steps=10**6), None)
    (tmp_path / 'summary.json').write_text('{"earlier": true}')
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        assert run.run() == []
    finally:
        signal.signal(signal.SIGALRM, before)
    run.close()
    assert run.stopped_by == signal.SIGINT
    assert runs.names(tmp_path) == {'summary.json'}
    assert runs.summary(tmp_path) == {'earlier': True}


# -- Without pictures ------------------------------------------------------------------------------


# -- As a module -----------------------------------------------------------------------------------


def _explore_as_module(*flag_words, cwd, **variables):
    return subprocess.run(
        [sys.executable, '-m', 'fetch_composer.explorer', *flag_words],
        env=runs.environment(**variables), cwd=cwd, capture_output=True, text=True,
    )  # fmt: skip


def test_the_module_does_what_the_script_does(tmp_path, filmed):
    folder, _ = filmed
    given = (
        '--episodes=1',
        f'--max_episode_steps={runs.STEPS}',
        f'--seed={runs.SEED}',
        *runs.SMALL,
    )
    result = _explore_as_module(*given, f'--output_dir={tmp_path / "out"}', cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert runs.names(tmp_path / 'out') == {
        'contact_sheet.png',
        'episode_000.mp4',
        'replay.html',
        *runs.PLAIN_FILES,
    }
    assert runs.summary(tmp_path / 'out')['gl_backend'] == runs.summary(folder)['gl_backend']
    with (
        np.load(folder / 'trajectories.npz') as script,
        np.load(tmp_path / 'out' / 'trajectories.npz') as module,
    ):
        np.testing.assert_array_equal(module['observation'][0], script['observation'][0])


def test_the_module_explains_a_mistake_in_one_line_too(tmp_path):
    result = _explore_as_module('--task=pusch', cwd=tmp_path, MUJOCO_GL='disabled')
    assert result.returncode == 1
    first, second = result.stderr.splitlines()
    assert first == 'No pictures: MUJOCO_GL=disabled.'
    assert second.startswith("python -m fetch_composer.explorer: error: Unknown task 'pusch'")


def test_a_replay_command_films_the_episode_that_it_stands_beside(tmp_path, filmed):
    folder, _ = filmed
    options = flags.make_options(runs.summary(folder)['flags'])
    command = shlex.split(flags.replay_command(options, options.policy, runs.SEED + 1))
    command.remove(f'--output_dir={folder}/seed_{runs.SEED + 1}')
    result = _explore_as_module(*command[3:], f'--output_dir={tmp_path}', cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    with imageio.get_reader(tmp_path / 'episode_000.mp4') as film:
        assert film.get_meta_data()['fps'] == 20
        assert film.get_meta_data()['size'] == (96, 64)
    with (
        np.load(folder / 'trajectories.npz') as run,
        np.load(tmp_path / 'trajectories.npz') as replay,
    ):
        for name in ('seed', 'observation', 'action', 'reward'):
            np.testing.assert_array_equal(replay[name], run[name][1:], err_msg=name)


# -- Places and tasks of one's own -----------------------------------------------------------------


def test_episodes_start_and_aim_where_they_are_told_to(tmp_path):
    given = {'object_position': [1.3, 0.9], 'goal': [1.2, 0.6, 0.4]}
    run = run_lib.Run(runs.options(output_dir=str(tmp_path), episodes=2, **given), None)
    run.run()
    run.close()
    with np.load(tmp_path / 'trajectories.npz') as file:
        np.testing.assert_allclose(file['achieved_goal'][:, 0, :2], [[1.3, 0.9]] * 2)
        np.testing.assert_allclose(file['desired_goal'][:, 0], [[1.2, 0.6, 0.4]] * 2)
    assert runs.summary(tmp_path)['flags']['goal'] == [1.2, 0.6, 0.4]


def test_the_documented_task_of_ones_own_is_explored(tmp_path):
    (tmp_path / 'gate.py').write_text(pages.code_of('new_task.md'))
    result = _explore_as_module(
        '--import=gate', '--task=push_through_gate', '--policy=random', '--episodes=2',
        '--output_dir=out', cwd=tmp_path, MUJOCO_GL='disabled',
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert runs.names(tmp_path / 'out') == runs.PLAIN_FILES
    report = (tmp_path / 'out' / 'report.html').read_text()
    assert '<span>--task=push_through_gate</span>' in report
    assert '<span>--import=gate</span>' in report


# -- Rooms -----------------------------------------------------------------------------------------


def test_every_task_can_be_explored(tmp_path):
    for task in (*tasks.published(), 'push_around', 'push_two', 'stack'):
        folder = tmp_path / task
        run = run_lib.Run(runs.options(task=task, policy=['random'], output_dir=str(folder)), None)
        run.run()
        run.close()
        assert runs.names(folder) == runs.PLAIN_FILES
        assert runs.summary(folder)['flags']['task'] == task


def test_an_earlier_run_leaves_no_films_behind_that_could_be_taken_for_new_ones(tmp_path):
    for name in ('episode_000.mp4', 'episode_001.mp4', 'contact_sheet.png', 'notes.txt'):
        (tmp_path / name).write_text('earlier')
    files = ['episode_001.mp4', 'contact_sheet.png', 'notes.txt', '../elsewhere']
    (tmp_path / 'summary.json').write_text(json.dumps({'files': files}))
    run = run_lib.Run(runs.options(output_dir=str(tmp_path)), None)
    run.run()
    run.close()
    # Only what the earlier run has listed, and what only a run can have written, is gone.
    assert runs.names(tmp_path) == {'episode_000.mp4', 'notes.txt', *runs.PLAIN_FILES}


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / 'file.txt'
    with files.whole_file(path) as partial:
        partial.write_text('whole')
        assert not path.exists()
    assert path.read_text() == 'whole'
    with pytest.raises(RuntimeError), files.whole_file(path) as partial:
        partial.write_text('ha')
        raise RuntimeError
    assert path.read_text() == 'whole'
    assert runs.names(tmp_path) == {'file.txt'}


@pytest.mark.parametrize(('steps', 'shown'), [(50, 8), (7, 8), (3, 4), (1, 2)])
def test_a_contact_sheet_shows_start_and_end_and_no_step_twice(steps, shown):
    selected = contact_sheet.shown_steps(steps)
    assert len(selected) == len(set(selected)) == shown
    assert selected[0] == 0 and selected[-1] == steps


def test_of_a_shorter_episode_it_shows_the_columns_of_the_others_and_its_own_end():
    assert contact_sheet.shown_steps(50, 20) == [0, 7, 14, 20]
    assert contact_sheet.shown_steps(50, 21) == [0, 7, 14, 21]
