"""What the explorer says: without OpenGL, to mistakes, and when it is asked for help."""

import os
import subprocess
import sys

import pytest

from fetch_composer.explorer import __main__ as command
from fetch_composer.explorer import run as run_lib
from fetch_composer.tasks import TaskOptions
from tests import runs


def test_pictures_can_be_switched_off(tmp_path):
    result = runs.explore('--episodes=1', f'--output_dir={tmp_path}', MUJOCO_GL='disabled')
    assert result.returncode == 0, result.stderr
    assert 'No pictures: MUJOCO_GL=disabled' in result.stderr
    assert 'apt-get' not in result.stderr
    assert runs.names(tmp_path) == runs.PLAIN_FILES
    assert runs.summary(tmp_path)['gl_backend'] is None


def test_opengl_is_chosen_before_anything_that_asks_for_it_is_imported():
    code = (
        'import runpy, sys\n'
        'gl = runpy.run_path("fetch_composer/explorer/gl.py")\n'
        'assert gl["choose"]() and gl["chosen"]() is None\n'
        'assert not {"fetch_composer", "dm_control", "mujoco"} & set(sys.modules)'
    )
    environment = runs.environment(MUJOCO_GL='off')
    subprocess.run([sys.executable, '-c', code], env=environment, cwd=runs.ROOT, check=True)


def test_broken_opengl_is_noticed_and_the_rest_is_written(tmp_path):
    broken = tmp_path / 'broken'
    broken.mkdir()
    for name in ('libEGL.so', 'libEGL.so.1', 'libOSMesa.so', 'libOSMesa.so.6', 'libOSMesa.so.8'):
        (broken / name).write_text('not a library')
    folder = tmp_path / 'out'
    result = subprocess.run(
        [sys.executable, runs.EXPLORE, '--episodes=1', f'--output_dir={folder}'],
        env=runs.environment(LD_LIBRARY_PATH=str(broken)),
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    assert 'apt-get install libegl1 libgl1-mesa-dri' in result.stderr
    assert 'apt-get install libosmesa6' in result.stderr
    assert runs.names(folder) == runs.PLAIN_FILES
    assert runs.names(tmp_path) == {'broken', 'out'}


def test_a_backend_that_the_user_chose_is_not_replaced_by_another(tmp_path):
    # It needs a display, and there is none.
    result = runs.explore('--episodes=1', f'--output_dir={tmp_path}', MUJOCO_GL='glfw')
    assert result.returncode == 0, result.stderr
    assert 'MUJOCO_GL=glfw is set, and does not work here' in result.stderr
    assert runs.names(tmp_path) == runs.PLAIN_FILES


@pytest.mark.parametrize('program', [(runs.EXPLORE,), ('-m', 'fetch_composer.explorer')])
def test_a_backend_that_there_is_not_is_refused_and_the_valid_ones_are_listed(tmp_path, program):
    result = subprocess.run(
        [sys.executable, *program, '--episodes=1', '--output_dir=out'],
        env=runs.environment(MUJOCO_GL='nonsense'),
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert 'MUJOCO_GL=nonsense' in line and 'valid are egl, osmesa' in line
    assert not runs.names(tmp_path)


# -- Mistakes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'task': 'pusch'}, r"Unknown task 'pusch'; valid are .*push"),
        ({'policy': ['exprt']}, r"Unknown policy 'exprt'; valid are expert, random, zero"),
        (
            {'convention': 'v1'},
            r"Unknown convention 'v1'; valid are documented, gymnasium_robotics",
        ),
        ({'reward_type': 'shaped'}, r"Unknown reward_type 'shaped'; valid are sparse, dense"),
        ({'camera': 'back'}, r"Unknown camera 'back'; valid are front, corner, .*head_camera"),
        ({'max_episode_steps': 0}, r'max_episode_steps must be a positive integer.*got 0'),
        ({'films': 'funny'}, r"Unknown films 'funny'; valid are worst, best, first, all, none"),
        ({'num_films': 0}, r'num_films must be a positive integer; got 0'),
        ({'num_envs': -1}, r'num_envs must be a positive integer; got -1'),
        ({'episodes': 0}, r'episodes must be a positive integer; got 0'),
        ({'seed': -1}, r'seed must be a non-negative integer; got -1'),
        ({'width': 0}, r'width must be an even number of pixels from 64 to 3840, got 0'),
        ({'width': 1_000_000}, r'width must be .* got 1000000'),
        ({'height': 65}, r'height must be an even number of pixels from 64 to 2160, got 65'),
        ({'fps': 0}, r'fps must be from 1 to 120'),
        ({'supersampling': 200}, r'at most 81 pixels with a supersampling of 200; got 64 and 96'),
    ],
)
def test_a_mistake_is_named_before_anything_is_written(tmp_path, changes, message):
    folder = tmp_path / 'out'
    with pytest.raises(ValueError, match=message):
        run_lib.Run(runs.options(output_dir=str(folder), **changes), None)
    assert not folder.exists()


def test_what_the_explorer_has_no_flag_for_is_refused():
    for name, value in (('observation_mode', 'pixels'), ('variations', {})):
        options = run_lib.Options(task_options=TaskOptions(**{name: value}))
        with pytest.raises(ValueError, match=f'{name} cannot be chosen.*valid are reward_type,'):
            options.check()
    endless = run_lib.Options(task_options=TaskOptions(max_episode_steps=None))
    with pytest.raises(ValueError, match='max_episode_steps must be a positive integer: episodes'):
        run_lib.Run(endless, None)


def _said(result):
    """Returns what was said of mistakes."""
    return [line for line in result.stderr.splitlines() if not line.startswith('No pictures')]


@pytest.mark.parametrize(
    ('flag', 'message'),
    [
        ('--gaol=1.3,0.8,0.42', "error: Unknown command line flag 'gaol'. Did you mean: goal"),
        ('--goal=1.3,here', 'error: flag --goal=1.3,here: must be numbers with commas between'),
        ('--goal=1.3,0.8', 'error: goal must be 3 finite numbers in m, got (1.3, 0.8)'),
        ('--object_position=9,9', 'error: object_position [9.0, 9.0] is off the table'),
        ('--import=nowhere', "error: There is no module 'nowhere' in the working directory"),
        ('--task=pusch', "error: Unknown task 'pusch'; valid are "),
        ('--output_dir={file}/out', 'error: Cannot write into --output_dir {file}/out: '),
        ('pusch', "error: unexpected argument 'pusch'"),
        ('--policy=math:cos', 'error: policy math:cos, before the first step: TypeError: '),
    ],
)
def test_a_mistake_is_one_line_without_a_traceback(tmp_path, capsys, flag, message):
    file = tmp_path / 'file'
    file.write_text('earlier')
    assert command.main([flag.format(file=file)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert message.format(file=file) in line
    assert runs.names(tmp_path) == {'file'}
    assert file.read_text() == 'earlier'


def test_a_folder_that_is_no_utf_8_is_refused(tmp_path):
    folder = os.fsencode(tmp_path) + b'/bad\xff'
    result = runs.explore('--episodes=1', b'--output_dir=' + folder)
    assert result.returncode == 1
    assert 'output_dir must be valid UTF-8' in result.stderr
    assert not runs.names(tmp_path)


def test_a_terminal_that_has_no_sign_for_something_gets_the_rest(tmp_path):
    folder = tmp_path / 'für-große'
    arguments = ['--episodes=1', '--films=none', f'--output_dir={folder}']
    result = runs.explore(*arguments, PYTHONIOENCODING='ascii')
    assert result.returncode == 0, result.stderr
    assert 'summary.json' in result.stdout


def test_a_module_that_opens_a_missing_file_is_answered_with_its_name(tmp_path):
    (tmp_path / 'opens.py').write_text("open('weights.bin')")
    arguments = ['--import=opens', f'--output_dir={tmp_path / "out"}']
    path = os.pathsep.join((str(runs.ROOT), str(tmp_path)))
    result = runs.explore(*arguments, PYTHONPATH=path)
    assert result.returncode == 1
    assert 'weights.bin' in result.stderr and 'Traceback' not in result.stderr
    assert 'output_dir' not in result.stderr


def test_a_missing_extra_is_named_with_the_way_to_install_it(tmp_path):
    (tmp_path / 'tqdm.py').write_text('raise ModuleNotFoundError("No tqdm", name="tqdm")')
    result = runs.explore(PYTHONPATH=f'{tmp_path}:{runs.ROOT}', MUJOCO_GL='disabled')
    assert result.returncode == 1
    assert "tqdm is not installed: pip install 'fetch_composer[explore]'" in result.stderr
    assert 'Traceback' not in result.stderr


def test_the_package_itself_needs_no_extra():
    runs.check_imports_none_of(
        'import fetch_composer, fetch_composer.policies',
        ('fetch_composer.explorer', 'imageio', 'matplotlib', 'tqdm', 'PIL'),
    )


def test_help_lists_every_flag():
    result = runs.explore('--help', MUJOCO_GL='disabled')
    assert result.returncode == 0 and not _said(result)
    for name in ('task', 'object_position', 'import', '[no]fresh'):
        assert f'--{name}: ' in result.stdout
