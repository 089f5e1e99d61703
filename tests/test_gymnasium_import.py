"""Where Gymnasium is missing, broken, or imported by nobody."""

import os
import subprocess
import sys

_WITHOUT_GYMNASIUM = """
import sys
sys.modules['gymnasium'] = None
import fetch_composer
fetch_composer.load('push', seed=0).reset()
try:
    import fetch_composer.interfaces.gymnasium_env
except ImportError as error:
    print(error)
"""


def test_everything_else_works_without_gymnasium():
    run = [sys.executable, '-c', _WITHOUT_GYMNASIUM]
    result = subprocess.run(run, capture_output=True, text=True, check=True)
    assert "pip install 'fetch_composer[gymnasium]'" in result.stdout


_BROKEN_GYMNASIUM = """
import fetch_composer
print(fetch_composer.load('push', seed=0).reset().observation['desired_goal'].shape)
"""


def test_a_gymnasium_that_cannot_be_used_breaks_nothing_else(tmp_path):
    (tmp_path / 'gymnasium.py').write_text("raise AttributeError('AutoresetMode')")
    result = subprocess.run(
        [sys.executable, '-c', _BROKEN_GYMNASIUM],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join((str(tmp_path), os.getcwd()))},
        capture_output=True,
        text=True,
    )
    assert result.stdout == '(3,)\n', result.stderr


_MAKE_WITHOUT_IMPORT = """
import gymnasium
env = gymnasium.make('fetch_composer:fetch_composer/FetchPush-v4')
print(env.reset(seed=0)[0]['observation'].shape)
"""


def test_an_id_with_its_module_needs_no_import():
    command = [sys.executable, '-c', _MAKE_WITHOUT_IMPORT]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.stdout == '(25,)\n', result.stderr


_LOOK_FIRST = """
import importlib.util
import fetch_composer
assert importlib.util.find_spec('gymnasium') and importlib.util.find_spec('dm_control.suite')
import gymnasium
print(gymnasium.make('fetch_composer/FetchPush-v4').reset(seed=0)[0]['observation'].shape)
from dm_control import suite
print(suite.load('fetch', 'push').reset().observation['observation'].shape)
"""


def test_who_looks_whether_a_library_is_there_loses_no_task():
    result = subprocess.run([sys.executable, '-c', _LOOK_FIRST], capture_output=True, text=True)
    assert result.stdout == '(25,)\n(25,)\n', result.stderr
