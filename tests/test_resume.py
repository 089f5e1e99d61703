"""A run that is killed is continued by the same command."""

import dataclasses
import itertools
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import fetch_composer
from fetch_composer.explorer import files, flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import provenance
from fetch_composer.explorer.pictures import film
from fetch_composer.explorer.results import store
from tests import episodes

_ROOT = pathlib.Path(__file__).parent.parent
_FLAGS = ('--policy=random', '--episodes=200', '--max_episode_steps=8', '--num_envs=4')


def _options(folder, **changes):
    small = {
        'policy': ['random'], 'episodes': 7, 'seed': 3, 'max_episode_steps': 4, 'num_envs': 2,
        'num_films': 2, 'width': 96, 'height': 64, 'output_dir': str(folder),
    }  # fmt: skip
    return flags.make_options({**small, **changes})


def _run(options, **kwargs):
    run = run_lib.Run(options, None, **kwargs)
    try:
        run.run()
    finally:
        run.close()
    return run


def _run_stopped(options, after):
    """Runs until some episodes are kept, then stops as on a signal."""
    run = run_lib.Run(options, None)
    add = run._store.add

    def add_then_stop(policy, episodes):
        add(policy, episodes)
        if len(run._store.episodes(policy, options.seeds)) >= after:
            signal.raise_signal(signal.SIGTERM)

    run._store.add = add_then_stop
    run.run()
    run.close()
    assert run.stopped_by == signal.SIGTERM
    return run


@pytest.fixture(scope='module')
def stopped_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp('stopped')
    _run_stopped(_options(folder), after=4)
    return folder


@pytest.fixture
def unfinished(stopped_once, tmp_path):
    """The folder of a run of seven episodes that was stopped after four."""
    return shutil.copytree(stopped_once, tmp_path / 'unfinished')


def _arrays(folder):
    with np.load(folder / 'trajectories.npz') as file:
        return dict(file)


def _figures(folder):
    summary = files.load_json(folder / 'summary.json')
    del summary['wall_seconds']
    for each in summary.get('policies', [summary]):
        del each['control_steps_per_second']
    summary['flags'].pop('output_dir')
    return summary


def _assert_same_results(folder, other):
    one, two = _arrays(folder), _arrays(other)
    assert one.keys() == two.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)
    assert _figures(folder) == _figures(other)


def test_a_killed_run_continues_to_the_result_of_an_uninterrupted_one(tmp_path):
    whole, killed = tmp_path / 'whole', tmp_path / 'killed'
    environment = {**os.environ, 'PYTHONPATH': str(_ROOT), 'MUJOCO_GL': 'disabled'}

    def command(folder):
        return [sys.executable, str(_ROOT / 'explore.py'), *_FLAGS, f'--output_dir={folder}']

    process = subprocess.Popen(
        command(killed), env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if len(list(killed.glob(f'{store.NAME}/*/episodes*.npz'))) > 2:
            break
        time.sleep(0.02)
    process.kill()
    process.wait()
    assert {path.name for path in killed.iterdir()} == {store.NAME}

    continued = subprocess.run(
        command(killed), env=environment, capture_output=True, text=True, check=True
    )
    assert 'Continued: ' in continued.stdout
    subprocess.run(command(whole), env=environment, capture_output=True, check=True)
    _assert_same_results(killed, whole)
    assert {p.name for p in killed.iterdir()} == {p.name for p in whole.iterdir()}


def test_finished_episodes_are_kept_and_none_is_counted_twice(tmp_path):
    options = _options(tmp_path / 'stopped')
    stopped = _run_stopped(options, after=4)
    assert stopped.finished == 4
    assert _figures(options.folder)['episodes_finished'] == 4
    # Other widths of the batch change nothing.
    resumed = _run(dataclasses.replace(options, num_envs=5))
    assert resumed.continued == 4 and resumed.finished == 7
    assert _arrays(options.folder)['seed'].tolist() == list(options.seeds)
    assert not (options.folder / store.NAME).exists()
    _run(_options(tmp_path / 'whole', num_envs=5))
    _assert_same_results(options.folder, tmp_path / 'whole')


def test_a_comparison_is_continued_policy_by_policy(tmp_path):
    options = _options(tmp_path / 'stopped', policy=['random', 'zero'])
    _run_stopped(options, after=6)
    assert _run(options).continued == 6
    _run(_options(tmp_path / 'whole', policy=['random', 'zero']))
    for name in ('1_random', '2_zero'):
        one, two = _arrays(options.folder / name), _arrays(tmp_path / 'whole' / name)
        np.testing.assert_array_equal(one['observation'], two['observation'])
    assert _figures(options.folder) == _figures(tmp_path / 'whole')


def test_more_episodes_can_be_asked_of_an_unfinished_run(unfinished):
    run = _run(_options(unfinished, episodes=9, seed=2))
    assert run.continued == 4
    assert _arrays(unfinished)['seed'].tolist() == list(range(2, 11))


def test_a_finished_run_is_run_anew(tmp_path):
    _run(_options(tmp_path))
    assert _run(_options(tmp_path)).continued == 0


def test_an_unfinished_run_of_other_options_is_left_alone(unfinished):
    before = {path: path.stat().st_mtime_ns for path in unfinished.rglob('*') if path.is_file()}
    for changes, name in (
        ({'reward_type': 'dense'}, 'reward_type'),
        ({'policy': ['zero']}, 'policies'),
        ({'object_position': [1.3, 0.75]}, 'object_position'),
        ({'goal': [1.3, 0.8, 0.42], 'convention': 'gymnasium_robotics'}, 'convention, goal'),
        ({'max_episode_steps': 3}, 'max_episode_steps'),
    ):
        with pytest.raises(ValueError, match=f'unfinished run that differs in {name}:.*--fresh'):
            run_lib.Run(_options(unfinished, **changes), None)
    after = {path: path.stat().st_mtime_ns for path in unfinished.rglob('*') if path.is_file()}
    assert after == before
    run = _run(_options(unfinished, reward_type='dense'), fresh=True)
    assert run.continued == 0 and run.finished == 7


def test_two_runs_do_not_share_a_folder(tmp_path):
    pytest.importorskip('fcntl')
    run = run_lib.Run(_options(tmp_path), None)
    with pytest.raises(ValueError, match='Another run is at work'):
        run_lib.Run(_options(tmp_path), None)
    run.close()
    _run(_options(tmp_path))


def _emptied(path):
    path.write_bytes(b'')


def _cut_off(path):
    path.write_bytes(path.read_bytes()[:-100])


def _of_something_else(path):
    with path.open('wb') as file:
        np.savez(file, steps=np.arange(3))


def _a_folder(path):
    path.unlink()
    path.mkdir()


_DAMAGES = (_emptied, _cut_off, _of_something_else, _a_folder, lambda p: p.write_text('nonsense'))


@pytest.mark.parametrize('damage', _DAMAGES)
def test_an_unreadable_file_of_the_store_is_run_again(unfinished, damage):
    options = _options(unfinished)
    for path in unfinished.glob(f'{store.NAME}/*/episodes*.npz'):
        damage(path)
    run = _run(options)
    assert run.continued == 0 and run.finished == 7
    assert _arrays(unfinished)['seed'].tolist() == list(options.seeds)


def test_changed_code_does_not_continue_what_other_code_began(unfinished, monkeypatch):
    monkeypatch.setattr(provenance, 'code_digest', lambda: 'other')
    with pytest.raises(ValueError, match='differs in code'):
        run_lib.Run(_options(unfinished), None)


def test_a_changed_mesh_does_not_continue_what_another_began(tmp_path, mesh):
    own = tmp_path / 'own.obj'
    shutil.copy(mesh, own)
    options = _options(tmp_path / 'run', task='push', object_shape='mesh', object_mesh=str(own))
    _run_stopped(options, after=4)
    own.write_text(own.read_text() + '\n# The same solid, but who would know.')
    with pytest.raises(ValueError, match='differs in mesh'):
        run_lib.Run(options, None)


# -- Films -----------------------------------------------------------------------------------------


def test_episodes_to_film_are_chosen_over_all_policies():
    distances = [[0.1, 0.5, 0.0, 0.2], [0.3, 0.1, 0.0, 0.0]]
    assert film.choose(distances, 'worst', 3) == [1, 0, 3]
    assert film.choose(distances, 'best', 2) == [2, 3]
    assert film.choose(distances, 'first', 2) == [0, 1]
    assert film.choose(distances, 'all', 2) == [0, 1, 2, 3]
    assert film.choose(distances, 'none', 2) == []
    assert film.choose(distances, 'worst', 9) == [1, 0, 3, 2]


def test_a_film_that_is_there_is_not_taken_again(tmp_path):
    class Camera:
        pictures = 0

        def picture(self):
            self.pictures += 1
            return np.full((64, 96, 3), 2 * self.pictures, np.uint8)

    env = fetch_composer.load('push', max_episode_steps=4)
    episode = episodes.record(env, 'random', 5)
    folder, camera = tmp_path / 'films', Camera()
    assert film.kept(folder, episode) is None

    def interrupt(step):
        if step == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film.take(folder, episode, env, camera, 25, interrupt)
    assert film.kept(folder, episode) is None
    taken = film.take(folder, episode, env, camera, 25, lambda step: None)
    kept = film.kept(folder, episode)
    for path, damage in itertools.product(sorted(folder.iterdir()), _DAMAGES):
        content = path.read_bytes()
        damage(path)
        assert film.kept(folder, episode) is None
        if path.is_dir():
            film.take(folder, episode, env, Camera(), 25, lambda step: None)
            assert film.kept(folder, episode) is not None
        path.write_bytes(content)
    assert kept.path == taken.path and taken.path.stat().st_size > 0
    assert len(kept.thumbnails) == len(taken.thumbnails) == 5
    assert len(kept.physics) == len(kept.gripper_pose) == 5
    np.testing.assert_array_equal(kept.physics, taken.physics)
    for one, other in zip(kept.thumbnails, taken.thumbnails, strict=True):
        np.testing.assert_array_equal(np.asarray(one), np.asarray(other))
