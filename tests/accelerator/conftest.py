"""Tests of the batch on a device; WARP_DEVICE names another one than the processor."""

import os

import pytest

_NOT_ASKED_FOR = 'It takes minutes: make test-warp.'


def pytest_collection_modifyitems(config, items):
    if 'warp' not in config.option.markexpr:
        for item in items:
            if item.get_closest_marker('warp'):
                item.add_marker(pytest.mark.skip(reason=_NOT_ASKED_FOR))


@pytest.fixture(scope='session')
def device() -> str:
    return os.environ.get('WARP_DEVICE', 'cpu')


@pytest.fixture
def make(device):
    """Returns a function that makes a batch on the device, and closes it after the test."""
    from fetch_composer import warp_batch

    made = []

    def function(task, num_envs, **options):
        made.append(warp_batch.WarpBatchEnvironment(task, num_envs, device, **options))
        return made[-1]

    yield function
    for each in made:
        each.close()
