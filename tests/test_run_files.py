"""The files of a run: data first, each whole, none of anyone else's, and none left behind."""

import json
import os
import pathlib

import numpy as np
import pytest

from fetch_composer import policies
from fetch_composer.explorer import files
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import episode as episode_lib
from fetch_composer.explorer.pictures import drawing, film, plots
from fetch_composer.explorer.report import page
from fetch_composer.explorer.results import store
from tests import networks, runs


def _run(folder, gl_backend=None, **changes):
    run = run_lib.Run(runs.options(output_dir=str(folder), **changes), gl_backend)
    try:
        run.run()
    finally:
        run.close()
    return run


def test_a_policy_may_have_any_name(tmp_path):
    paths = [tmp_path / name for name in ('$x^$.onnx', '$\\frac{<b>&"\'\n%s{0}#.onnx')]
    for path in paths:
        networks.save(str(path), [('observation', ['batch', 25])])
    run = _run(tmp_path / 'out', policy=list(map(str, paths)), num_envs=1)
    assert not run.remarks
    report = (tmp_path / 'out' / 'report.html').read_text()
    assert '<b>' not in report and '&lt;b&gt;' in report


@pytest.mark.parametrize(
    ('module', 'function', 'name'),
    [(plots, 'save_progress', 'progress.png'), (page, 'render', 'report.html')],
)
def test_a_picture_that_fails_costs_that_picture(tmp_path, monkeypatch, module, function, name):
    _run(tmp_path)

    def fail(*arguments, **more):
        # What was found is there already.
        assert len(np.load(tmp_path / 'trajectories.npz')['seed']) == 2
        assert runs.summary(tmp_path)['episodes_finished'] == 2
        raise RuntimeError('out of paint')

    monkeypatch.setattr(module, function, fail)
    run = _run(tmp_path, episodes=2)
    assert run.remarks == [f'No {name}: RuntimeError: out of paint']
    assert run.finished == 2
    # Nor is the one of the run before taken for this one's.
    assert runs.names(tmp_path) == runs.PLAIN_FILES - {name}
    assert set(runs.summary(tmp_path)['files']) == runs.PLAIN_FILES - {name}


@pytest.mark.parametrize('error', [drawing.DrawingError('no light'), OSError('no light')])
def test_results_are_written_though_films_cannot_be_taken(tmp_path, monkeypatch, error):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(drawing.Drawer, 'take', fail)
    monkeypatch.setattr(film, 'kept', lambda *arguments: None)
    with pytest.raises(drawing.DrawingError, match='no light'):
        _run(tmp_path, gl_backend='egl')
    assert runs.names(tmp_path) == runs.PLAIN_FILES | {store.NAME}
    assert runs.summary(tmp_path)['episodes_finished'] == 1


@pytest.mark.parametrize('before', [5, {'a': 1}, [5, None, ['a'], '../a']])
def test_any_summary_may_lie_there(tmp_path, before):
    (tmp_path / 'summary.json').write_text(json.dumps({'files': before}))
    _run(tmp_path)
    assert runs.names(tmp_path) == runs.PLAIN_FILES


def test_what_a_killed_run_has_half_written_is_removed_and_nothing_else(tmp_path):
    class Killed(BaseException):
        pass

    parts = []
    for folder in (tmp_path, tmp_path / '1_zero'):
        folder.mkdir(exist_ok=True)
        with pytest.raises(Killed), files.whole_file(folder / 'progress.png') as partial:
            partial.write_text('half')
            parts.append(partial.parent)
            raise Killed
    for part in parts:  # A process that is killed does not come to remove it.
        part.mkdir()
        (part / 'progress.png').write_text('half')
    (tmp_path / '.mine.part.png').write_text('mine')
    _run(tmp_path, policy=['zero', 'random'])
    assert not [path for path in tmp_path.rglob('*') if path in parts]
    assert (tmp_path / '.mine.part.png').read_text() == 'mine'


def test_a_part_is_where_nobody_else_can_put_a_link(tmp_path):
    with files.whole_file(tmp_path / 'summary.json') as partial:
        assert partial.parent.parent == tmp_path
        assert os.name != 'posix' or partial.parent.stat().st_mode & 0o077 == 0
        partial.write_text('whole')
    assert runs.names(tmp_path) == {'summary.json'}


def test_links_in_the_place_of_files_are_replaced_and_not_followed(tmp_path):
    folder, elsewhere = tmp_path / 'out', tmp_path / 'elsewhere'
    folder.mkdir()
    elsewhere.write_text('precious')
    for name in runs.PLAIN_FILES:
        (folder / name).symlink_to(elsewhere)
    _run(folder)
    assert elsewhere.read_text() == 'precious'
    assert not any(path.is_symlink() for path in folder.iterdir())


def test_a_link_in_the_place_of_the_store_is_refused_and_not_cleared(tmp_path):
    folder, precious = tmp_path / 'out', tmp_path / 'precious'
    (precious / 'episodes').mkdir(parents=True)
    folder.mkdir()
    (folder / store.NAME).symlink_to(precious)
    with pytest.raises(ValueError, match='is a link to elsewhere'):
        run_lib.Run(runs.options(output_dir=str(folder)), None, fresh=True)
    assert (precious / 'episodes').is_dir()


def test_more_episodes_than_fit_into_memory_are_refused_with_the_number_that_fits(tmp_path):
    for asked in (10**8, 10**12, 10**30):
        with pytest.raises(ValueError, match=r'episodes must be at most \d+ of 50 steps') as caught:
            runs.options(episodes=asked, max_episode_steps=50).check()
    fitting = int(str(caught.value).split()[5])
    runs.options(episodes=fitting, max_episode_steps=50).check()
    with pytest.raises(ValueError, match='episodes must be at most'):
        runs.options(episodes=fitting + 1, max_episode_steps=50).check()
    with pytest.raises(ValueError, match=f'at most {fitting // 2}'):
        runs.options(episodes=fitting, policy=['zero', 'random'], max_episode_steps=50).check()
    with pytest.raises(ValueError, match='max_episode_steps is 10+, of which no episode fits'):
        runs.options(max_episode_steps=10**15).check()


@pytest.mark.parametrize('first', [2**63 - 1, 2**64 - 2])
def test_seeds_stay_what_they_are_in_files(tmp_path, first):
    _run(tmp_path, seed=first, episodes=2)
    with np.load(tmp_path / 'trajectories.npz') as arrays:
        assert arrays['seed'].tolist() == [first, first + 1]
    assert [each['seed'] for each in runs.summary(tmp_path)['episodes']] == [first, first + 1]
    assert episode_lib.seed_array([2**63 - 1, 2**63]).tolist() == [2**63 - 1, 2**63]


def test_seeds_that_files_cannot_hold_are_refused():
    with pytest.raises(ValueError, match=f'seed must be at most {2**64 - 2} for 2 episodes'):
        runs.options(seed=2**64 - 1, episodes=2).check()


def test_a_policy_that_ends_python_ends_no_run_in_silence(tmp_path, monkeypatch):
    code = (
        'import sys\n'
        'class Policy:\n'
        '    def __init__(self, seed):\n'
        '        self.seed = seed\n'
        '    def __call__(self, observation):\n'
        '        if self.seed == 2:\n'
        '            sys.exit(0)\n'
        '        return [0, 0, 0, 0]\n'
    )
    (tmp_path / 'own_leaver.py').write_text(code)
    folder = pathlib.Path('out')
    command = ('--policy=own_leaver:Policy', '--num_envs=1', '--max_episode_steps=3')
    monkeypatch.chdir(tmp_path)
    ended = runs.explore(*command, f'--output_dir={folder}', MUJOCO_GL='disabled')
    assert ended.returncode == 1
    assert 'policy own_leaver:Policy, step 0: SystemExit: 0 (own_leaver.py, line 7)' in ended.stderr
    (tmp_path / 'own_leaver.py').write_text(code)  # Which is what it was.
    again = runs.explore(*command, f'--output_dir={folder}', '--episodes=2', MUJOCO_GL='disabled')
    assert again.returncode == 0
    assert 'Continued: 2 episodes were there already.' in again.stdout


def test_a_network_whose_weights_have_changed_does_not_go_on(tmp_path):
    path = tmp_path / 'policy.onnx'
    networks.save(str(path), [('observation', ['batch', 25])])
    apart = networks.keep_weights_apart(path)
    run = run_lib.Run(runs.options(output_dir=str(tmp_path), policy=[str(path)], episodes=2), None)
    add = run._store.add

    def add_and_fail(*arguments):
        add(*arguments)
        raise policies.ActionError

    run._store.add = add_and_fail
    with pytest.raises(policies.ActionError):
        run.run()
    run.close()
    weights = bytearray(apart.read_bytes())
    weights[0] ^= 1
    apart.write_bytes(weights)
    with pytest.raises(ValueError, match='unfinished run that differs in policies'):
        _run(tmp_path, policy=[str(path)], episodes=2)


@pytest.mark.parametrize(
    'name', ['width', 'height', 'fps', 'episodes', 'seed', 'max_episode_steps']
)
def test_numbers_of_too_many_digits_are_refused_by_name(name):
    with pytest.raises(ValueError, match=f'{name} .* a int'):
        runs.options(**{name: 10**5000}).check()
