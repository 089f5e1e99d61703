"""What a run prints: within 80 columns, with one bar in a terminal, and few lines elsewhere."""

import contextlib
import io
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import time

import pytest

from fetch_composer.explorer import __main__ as main_lib
from fetch_composer.explorer import progress
from fetch_composer.explorer.results import writing

_ROOT = pathlib.Path(__file__).parent.parent
_COLUMNS = 80
_LONG = 'a_folder_with_a_long_name/' * 4 + 'policy'


def _show(file):
    with progress.Progress(file) as bar:
        for unit in ('step', 'frame'):
            bar.start(_LONG, unit, 1000, 100)
            bar.label(_LONG)
            for _ in range(3):
                bar.advance(300)


def test_a_terminal_shows_one_bar(monkeypatch):
    fcntl, termios = pytest.importorskip('fcntl'), pytest.importorskip('termios')
    monkeypatch.setattr(progress, '_SECONDS_BETWEEN_REDRAWS', 0)
    reader, writer = os.openpty()
    fcntl.ioctl(writer, termios.TIOCSWINSZ, struct.pack('HHHH', 24, _COLUMNS, 0, 0))
    with os.fdopen(writer, 'w') as file:
        _show(file)
    written = ''
    with contextlib.suppress(OSError):  # Which says that no more follows.
        while part := os.read(reader, 10_000).decode():
            written += part
    os.close(reader)
    assert '\n' not in written  # It is drawn over itself, and over at the end.
    drawn = written.split('\r')
    assert max(map(len, drawn)) <= _COLUMNS
    assert any('1000/1000' in each and 'frame' in each for each in drawn)


@pytest.mark.parametrize(('seconds', 'count'), [(10, 4), (0, 10)])
def test_elsewhere_there_is_a_line_every_some_seconds(monkeypatch, seconds, count):
    monkeypatch.setattr(progress, '_SECONDS_BETWEEN_LINES', seconds)
    file = io.StringIO()
    _show(file)
    assert '\r' not in file.getvalue()
    lines = file.getvalue().splitlines()
    assert max(map(len, lines)) <= _COLUMNS
    assert all(re.search(r'policy: +\d+%\|.*/1000 ', line) for line in lines)
    assert 4 <= len(lines) <= count  # The first and the last of each part, whatever the seconds.


def test_few_lines_and_no_returns_are_written_to_a_file(tmp_path):
    result = subprocess.run(
        [
            sys.executable, '-m', 'fetch_composer.explorer', '--episodes=300',
            '--max_episode_steps=5', '--num_envs=8', '--policy=zero', '--policy=random',
            f'--output_dir={tmp_path / "out"}',
        ],
        env={**os.environ, 'MUJOCO_GL': 'disabled', 'PYTHONPATH': str(_ROOT)},
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True,
    )  # fmt: skip
    assert '\r' not in result.stdout
    lines = result.stdout.splitlines()
    assert len(lines) < 30
    results = [line for line in lines if '%' in line and '|' not in line]
    assert [re.sub('[0-9.]+', '#', line) for line in results] == [
        'Success # % (# to # %) of # episodes: zero',
        'Success # % (# to # %) of # episodes: random',
    ]
    for line in lines:
        assert len(line) <= _COLUMNS or str(tmp_path) in line, line


@pytest.mark.parametrize('name', ['progress.png', '1_a_policy_of_a_long_name/progress.png'])
def test_listed_files_are_aligned(name):
    written = [
        writing.Written((name, name.replace('1', '2')), 'distance and return over time'),
        writing.Written((writing.SUMMARY,), 'figures'),
    ]
    lines = '\n'.join(main_lib._listed(written)).splitlines()
    assert max(map(len, lines)) <= 2 * len(name) + 7 or max(map(len, lines)) <= _COLUMNS
    places = {
        line.index(content)
        for line in lines
        for content in ('distance and', 'figures')
        if content in line
    }
    assert len(places) == 1


# -- Films, which another process takes ------------------------------------------------------------


def _filming(folder):
    """Starts a run, and waits until it takes films; returns its process."""
    process = subprocess.Popen(
        [
            sys.executable, str(_ROOT / 'explore.py'), '--policy=zero', '--episodes=40',
            '--max_episode_steps=20', '--films=all', '--width=96', '--height=64',
            f'--output_dir={folder}',
        ],
        env={**os.environ, 'PYTHONPATH': str(_ROOT)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        if len(list(folder.glob('.unfinished_run/1_zero/films_*/*.npz'))) > 1:
            return process
        time.sleep(0.02)
    output, _ = process.communicate()
    if 'No pictures' in output:
        pytest.skip('no OpenGL backend works here')
    raise AssertionError(output)


def _drawers():
    """Returns the processes of this user that take films."""
    found = set()
    for path in pathlib.Path('/proc').glob('[0-9]*'):
        try:
            if 'drawing.serve()' in (path / 'cmdline').read_text():
                found.add((path.name, (path / 'environ').read_text().split('MARK=')[1][:20]))
        except (OSError, IndexError, UnicodeDecodeError):
            continue
    return found


@pytest.mark.skipif(not pathlib.Path('/proc').exists(), reason='looks for processes in /proc')
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGKILL])
def test_no_process_is_left_when_films_are_stopped(tmp_path, monkeypatch, number):
    monkeypatch.setenv('MARK', f'{os.getpid()}_{number:d}_'.ljust(20, 'x'))
    process = _filming(tmp_path)
    mark = os.environ['MARK']
    assert any(each == mark for _, each in _drawers())
    process.send_signal(number)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == (-number if number == signal.SIGKILL else 128 + number), output
    assert 'Traceback' not in output
    deadline = time.monotonic() + 10
    while any(each == mark for _, each in _drawers()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(each == mark for _, each in _drawers())
    assert not list(tmp_path.rglob('.*.part*'))
