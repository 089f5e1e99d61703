"""Fixtures: every statement is made about every published task, in both conventions.

What holds for tasks of several objects and of obstacles is in test_several_objects.py.
"""

import os
import pathlib

# Tests need no display; they render where one of these works and are skipped elsewhere.
os.environ.setdefault('MUJOCO_GL', 'egl')

import pytest  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import tasks  # noqa: E402
from fetch_composer.entities import shapes  # noqa: E402
from fetch_composer.tasks import conventions  # noqa: E402

CONVENTIONS = tuple(conventions.CONVENTIONS)


@pytest.fixture(params=tasks.published())
def task_name(request) -> str:
    return request.param


@pytest.fixture(params=CONVENTIONS)
def convention(request) -> str:
    return request.param


@pytest.fixture(params=[name for name in tasks.published() if name != 'reach'])
def object_task_name(request) -> str:
    return request.param


@pytest.fixture(params=[name for name in tasks.published() if name != 'pick_and_place'])
def locked_task_name(request) -> str:
    return request.param


@pytest.fixture
def env(task_name, convention):
    environment = fetch_composer.load(task_name, seed=0, convention=convention)
    yield environment
    environment.close()


@pytest.fixture(params=shapes.NAMES)
def shape(request) -> str:
    return request.param


@pytest.fixture
def mesh() -> str:
    """A wedge: neither its middle nor its axes are those of its inertia."""
    return str(pathlib.Path(__file__).with_name('wedge.obj'))
