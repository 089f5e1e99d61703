"""Long episodes of actions that are meant to break the physics, in every task and convention."""

import functools
import gc
import os
import pathlib
import random
import subprocess
import sys

import numpy as np

from tests import runs
from tests.hostile import variants
from tests.hostile.tally import Tally

_ROWS = 4
_STEPS = 50


def _actions(kind: str, generator: np.random.Generator, shape: tuple[int, int, int]) -> np.ndarray:
    """Returns (steps, rows, size of an action) actions."""
    steps, one_step = shape[0], (1, *shape[1:])
    if kind == 'corners':
        return generator.choice((-1.0, 1.0), shape)
    if kind == 'one corner':
        return np.broadcast_to(generator.choice((-1.0, 1.0), one_step), shape).copy()
    if kind == 'into the table':
        actions = generator.uniform(-1, 1, shape)
        actions[..., 2] = -1
        return actions
    if kind == 'to and fro':
        signs = np.where(np.arange(steps) % 2, -1.0, 1.0)[:, np.newaxis, np.newaxis]
        return signs * generator.choice((-1.0, 1.0), one_step)
    if kind == 'huge':
        return generator.uniform(-1, 1, shape) * 10.0 ** generator.integers(0, 300, shape)
    if kind == 'tiny':
        return generator.uniform(-1, 1, shape) * 10.0 ** -generator.integers(0, 320, shape)
    return generator.integers(-128, 127, shape).astype(np.int8)


_KINDS = ('corners', 'one corner', 'into the table', 'to and fro', 'huge', 'tiny', 'integers')


@functools.cache
def _single(variant):
    return variants.single(variant, max_episode_steps=4 * _STEPS)


@functools.cache
def _batch(variant):
    return variants.batch(variant, _ROWS, max_episode_steps=4 * _STEPS)


def _check(observation) -> None:
    for name, value in observation.items():
        assert np.isfinite(value).all(), name
        assert np.abs(value).max() < 100, f'{name} is far away: {np.abs(value).max()}'


def singles(tally: Tally, seed: int, count: int) -> None:
    """Steps single environments."""
    generator = np.random.default_rng(seed)
    for index in range(count):
        env = _single(variants.ALL[(seed * count + index) % len(variants.ALL)])
        kind = random.Random(f'{seed} {index}').choice(_KINDS)
        for (action,) in _actions(kind, generator, (_STEPS, 1, *env.action_spec().shape)):
            time_step = env.step(action)
            tally.add(was_refused=False)
        _check(time_step.observation)


def batches(tally: Tally, seed: int, count: int) -> None:
    """Steps batches, and resets some of their rows in between."""
    generator = np.random.default_rng(seed)
    for index in range(count):
        batch = _batch(variants.ALL[(seed * count + index) % len(variants.ALL)])
        batch.reset(generator.random(_ROWS) < 0.5)
        kind = random.Random(f'{seed} {index}').choice(_KINDS)
        for action in _actions(kind, generator, (_STEPS, *batch.action_spec().shape)):
            time_step = batch.step(action)
            tally.tried += _ROWS
        _check(time_step.observation)


# Bytes by which a process may grow: some of what is left is Python's and MuJoCo's to use again.
_MOST_GROWTH = 32 * 2**20


def _resident() -> int:
    statistics = pathlib.Path('/proc/self/statm').read_text().split()
    return int(statistics[1]) * os.sysconf('SC_PAGE_SIZE')


def _made_and_closed(variant) -> None:
    env = variants.single(variant)
    env.reset()
    env.step(np.ones(env.action_spec().shape, np.float32))
    env.close()
    with variants.batch(variant, 2) as batch:
        batch.reset()
        batch.step(np.ones(batch.action_spec().shape, np.float32))


def measure(index: int, count: int) -> None:
    """Makes and closes environments in a process that has done nothing else.

    What is kept to be used again grows to its largest extent in the first `count` times; a leak
    goes on in the second.
    """
    variant = variants.ALL[index % len(variants.ALL)]
    for _ in range(count):
        _made_and_closed(variant)
    gc.collect()
    before, files, threads = _resident(), _entries('fd'), _entries('task')
    for _ in range(count):
        _made_and_closed(variant)
    gc.collect()
    grown = _resident() - before
    assert grown < _MOST_GROWTH, f'{variant}: {grown / 2**20:.1f} MiB after {count}'
    assert _entries('fd') <= files and _entries('task') <= threads, variant


def _entries(name: str) -> int:
    return len(os.listdir(f'/proc/self/{name}'))


def leaks(tally: Tally, seed: int, count: int) -> None:
    """Makes and closes environments; neither memory, nor files, nor threads are left."""
    if not pathlib.Path('/proc/self/statm').exists():
        return  # Other systems have other ways to tell.
    code = f'from tests.hostile import endurance; endurance.measure({seed}, {count})'
    process = subprocess.run(
        [sys.executable, '-c', code],
        env=runs.environment(MUJOCO_GL='disabled'),
        cwd=runs.ROOT,
        capture_output=True,
        text=True,
    )
    assert process.returncode == 0, process.stderr
    tally.tried += count


ALL = {
    'adversarial control steps of single environments': singles,
    'adversarial control steps of batches': batches,
    'environments made and closed': leaks,
}
