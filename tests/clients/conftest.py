"""Fixtures: the examples are run as a reader would run them."""

import os
import pathlib
import subprocess
import sys

import pytest

_ROOT = pathlib.Path(__file__).parents[2]


@pytest.fixture
def run_example(tmp_path):
    """Returns a function that runs an example and returns what it printed."""

    def run(name: str, *arguments: str) -> str:
        result = subprocess.run(
            [sys.executable, _ROOT / 'examples' / name, *arguments],
            cwd=tmp_path,
            # Mesa's LLVM and that of torch's compiler do not mix: see docs/clients.md.
            env={**os.environ, 'MUJOCO_GL': 'disabled'},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert result.returncode == 0, result.stdout
        return result.stdout

    return run
