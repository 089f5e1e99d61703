"""A digest tells whether anything that a policy consists of has changed since."""

import sys

import numpy as np
import pytest

from fetch_composer import policies, user_modules
from tests import networks


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        del sys.modules[name]


def _write(folder, files):
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


_FILES = {
    'own_policy.py': (
        'import json\n'
        'import own_direct\n'
        'from own_package import inner\n'
        'import own_space.member\n'
        'def act(observation):\n'
        '    import own_lazy\n'
        '    return [own_lazy.number, 0, 0, 0]\n'
    ),
    'own_direct.py': 'from own_indirect import number\n',
    'own_indirect.py': 'import own_direct\nnumber = 1\n',
    'own_lazy.py': 'import importlib\nnumber = importlib.import_module("own_by_name").number\n',
    'own_by_name.py': 'number = 1\n',
    'own_package/__init__.py': '',
    'own_package/inner.py': 'from . import beside\nfrom .deeper.deepest import number\n',
    'own_package/beside.py': '',
    'own_package/deeper/__init__.py': '',
    'own_package/deeper/deepest.py': 'from ..upstairs import number\n',
    'own_package/upstairs.py': 'number = 1\n',
    'own_space/member.py': '',
    'own_stranger.py': '',
}


def test_every_module_of_its_folder_that_code_needs_counts(folder):
    _write(folder, _FILES)
    user_modules.load('own_policy')
    digests = {policies.digest('own_policy:act')}
    for name, text in _FILES.items():
        (folder / name).write_text(f'{text}# Changed.\n')
        digests.add(policies.digest('own_policy:act'))
    # All but the one that nothing imports.
    assert len(digests) == len(_FILES)
    assert digests == digests | {policies.digest('own_policy:act')}


def test_a_module_that_registers_a_task_counts_with_what_it_needs(folder):
    _write(folder, {'own_task.py': 'import own_figures\n', 'own_figures.py': 'number = 1\n'})
    user_modules.load('own_task')
    before = user_modules.digest('own_task')
    _write(folder, {'own_figures.py': 'number = 2\n'})
    assert before != user_modules.digest('own_task')


@pytest.mark.parametrize(
    'line',
    [
        'importlib.import_module("own_" + "network")',
        '__import__(name)',
        'importlib.util.spec_from_file_location("a", "a.py")',
        'runpy.run_path("a.py")',
    ],
)
def test_code_of_which_it_cannot_be_told_what_it_runs_is_refused(folder, line):
    _write(folder, {'own_vague.py': f'def act(observation):\n    {line}\n'})
    user_modules.load('own_vague')
    with pytest.raises(ValueError, match=r'own_vague\.py, line 2: what \w+ runs'):
        policies.digest('own_vague:act')


def test_what_comes_with_python_counts_by_its_version(folder):
    user_modules.load('json.decoder')
    assert user_modules.digest('json.decoder') is None


def test_code_without_a_file_is_refused(folder):
    (folder / 'own_empty').mkdir()
    user_modules.load('own_empty')
    with pytest.raises(ValueError, match="'own_empty' has no file"):
        user_modules.digest('own_empty')


def test_the_weights_that_a_network_keeps_in_files_of_their_own_count(tmp_path):
    path = tmp_path / 'policy.onnx'
    networks.save(str(path), [('observation', ['batch', 25])])
    inline = policies.digest(str(path))
    apart = networks.keep_weights_apart(path)
    before = policies.digest(str(path))
    assert before != inline
    weights = bytearray(apart.read_bytes())
    assert len(weights) >= 25 * 4 * np.float32().nbytes
    weights[-1] ^= 1
    apart.write_bytes(weights)
    assert policies.digest(str(path)) != before
    apart.unlink()
    with pytest.raises(ValueError, match=r'policy\.onnx has weights in weights\.bin: No such file'):
        policies.digest(str(path))


def test_a_network_of_which_it_cannot_be_told_where_its_weights_are_is_refused(
    tmp_path, monkeypatch
):
    path = str(tmp_path / 'policy.onnx')
    networks.save(path, [('observation', ['batch', 25])])
    monkeypatch.setitem(sys.modules, 'onnx', None)
    with pytest.raises(ValueError, match=r"takes onnx to tell: pip install 'fetch_composer\[onnx"):
        policies.digest(path)
