"""What explore.py says where a package is missing that only one of its flags needs."""

import pathlib
import subprocess
import sys

import pytest

_ROOT = pathlib.Path(__file__).parent.parent
_WITHOUT = (
    'import runpy, sys\n'
    'sys.modules[sys.argv.pop(1)] = None\n'
    'runpy.run_path("explore.py", run_name="__main__")\n'
)


@pytest.mark.parametrize(
    ('package', 'flag', 'extra'),
    [
        ('ray', '--ray=local', 'ray'),
        ('minari', '--dataset=push-v0', 'minari'),
        ('h5py', '--dataset=push-v0', 'minari'),
        ('lerobot', '--dataset=lerobot:push', 'lerobot'),
    ],
)
def test_a_missing_package_is_named_with_what_installs_it(tmp_path, package, flag, extra):
    if package == 'h5py':
        pytest.importorskip('minari')
    folder = tmp_path / 'output'
    result = subprocess.run(
        [sys.executable, '-c', _WITHOUT, package, flag, f'--output_dir={folder}'],
        cwd=_ROOT,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 1
    assert result.stderr.count('\n') == 1
    assert f"pip install 'fetch_composer[{extra}]'" in result.stderr
    assert not folder.exists()
