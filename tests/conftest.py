"""Fixtures: every statement is made about every published task, in both conventions.

What holds for tasks of several objects and of obstacles is in test_several_objects.py.
"""

import gc
import os
import pathlib
import tempfile

# Tests need no display; they render where one of these works and are skipped elsewhere.
os.environ.setdefault('MUJOCO_GL', 'egl')
# What JAX compiles for one test is there for the next, and for the processes that tests start.
if 'JAX_COMPILATION_CACHE_DIR' not in os.environ:
    _compiled = tempfile.TemporaryDirectory(prefix='fetch_composer_tests_')
    os.environ['JAX_COMPILATION_CACHE_DIR'] = _compiled.name
    os.environ['JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS'] = '0.1'
# As the learner's own command has it; and to compile well takes longer than these networks take.
os.environ.setdefault(
    'XLA_FLAGS',
    '--xla_cpu_multi_thread_eigen=false --xla_backend_optimization_level=0',
)

# Models are trees of many small objects. Python would look through all of them a dozen times while
# one is made, for a third of the time.
gc.set_threshold(100_000, 20, 20)

import pytest  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import tasks  # noqa: E402
from fetch_composer.entities import shapes  # noqa: E402
from fetch_composer.tasks import conventions  # noqa: E402
from tests import episodes  # noqa: E402

CONVENTIONS = tuple(conventions.CONVENTIONS)


@pytest.fixture(autouse=True, scope='module')
def _libraries_are_left_alone():
    """With every library imported, to look through all objects for garbage takes seconds."""
    gc.collect()
    gc.freeze()


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


@pytest.fixture
def shared_env(task_name, convention):
    """The same, for tests that step and reset it, and no more."""
    return episodes.shared(task_name, convention=convention)


@pytest.fixture(params=shapes.NAMES)
def shape(request) -> str:
    return request.param


@pytest.fixture
def mesh() -> str:
    """A wedge: neither its middle nor its axes are those of its inertia."""
    return str(pathlib.Path(__file__).with_name('wedge.obj'))
