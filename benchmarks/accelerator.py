"""Measures the batch on an accelerator beside the native one: `python -m benchmarks.accelerator`.

Both take actions that are drawn beforehand, each where it computes, and episodes begin anew as they
end. A device is waited for before each round's clock is stopped.
"""

import argparse
import json
import pathlib
import platform
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import mujoco_warp
import numpy as np
import warp as wp

from benchmarks import markdown
from fetch_composer import tasks
from fetch_composer.batch import BatchEnvironment
from fetch_composer.batch.simulations import num_processors
from fetch_composer.tasks import conventions
from fetch_composer.warp_batch import WarpBatchEnvironment

_MARKER = 'accelerator table: made by python -m benchmarks.accelerator'
_HEADER = (
    'task',
    'convention',
    'batch',
    'environments',
    'control steps a second',
    'memory',
    'first step',
)
_ROUNDS, _STEPS = 5, 20
_NUM_ACTIONS = 8
_TASKS = tasks.published()
_CONVENTIONS = tuple(conventions.CONVENTIONS)


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='python -m benchmarks.accelerator', description=__doc__)
    parser.add_argument('--device', help='a device of Warp; the first accelerator by default')
    parser.add_argument('--num_envs', type=int, nargs='+', default=[256, 1024, 4096, 16384])
    parser.add_argument('--tasks', nargs='+', choices=_TASKS, default=['push'])
    parser.add_argument(
        '--conventions', nargs='+', choices=_CONVENTIONS, default=list(_CONVENTIONS)
    )
    parser.add_argument('--native', type=int, nargs='*', default=[256, 1024])
    parser.add_argument('--rounds', type=int, default=_ROUNDS)
    parser.add_argument('--output', type=pathlib.Path, help='a JSON file of the figures')
    parser.add_argument('--write', type=pathlib.Path, help='a page whose table is replaced')
    parser.add_argument('--read', type=pathlib.Path, help='such a file, in place of measuring')
    return parser.parse_args(arguments)


def _rounds(step: Callable[[Any], Any], wait: Callable[[], None], actions, rounds: int) -> float:
    """Returns the median of seconds that a control step of all environments takes."""
    seconds = []
    for _ in range(rounds):
        wait()
        start = time.perf_counter()
        for i in range(_STEPS):
            step(actions[i % len(actions)])
        wait()
        seconds.append((time.perf_counter() - start) / _STEPS)
    return statistics.median(seconds)


def _actions(num_envs: int) -> np.ndarray:
    random = np.random.default_rng(0)
    return random.uniform(-1, 1, (_NUM_ACTIONS, num_envs, 4)).astype(np.float32)


def _measured_on_device(task: str, convention: str, num_envs: int, options) -> dict[str, Any]:
    device = wp.get_device(options.device) if options.device else wp.get_preferred_device()
    start = time.perf_counter()
    with WarpBatchEnvironment(task, num_envs, str(device), seed=0, convention=convention) as batch:
        batch.reset()
        actions = [wp.array(each, device=device) for each in _actions(num_envs)]
        batch.step(actions[0])
        batch.check()
        first = time.perf_counter() - start
        seconds = _rounds(batch.step, batch.check, actions, options.rounds)
        memory = device.total_memory - device.free_memory if device.is_cuda else None
    return {
        'batch': device.name if device.is_cuda else f'Warp on {device.name}',
        'steps_per_second': num_envs / seconds,
        'memory': memory,
        'first_step': first,
    }


def _measured_native(task: str, convention: str, num_envs: int, options) -> dict[str, Any]:
    start = time.perf_counter()
    with BatchEnvironment(task, num_envs, seed=0, convention=convention) as batch:
        batch.reset()
        actions = _actions(num_envs)
        batch.step(actions[0])
        first = time.perf_counter() - start
        seconds = _rounds(batch.step, lambda: None, actions, options.rounds)
        name = f'native, {batch.num_threads} threads'
    return {
        'batch': name,
        'steps_per_second': num_envs / seconds,
        'memory': None,
        'first_step': first,
    }


def _measure(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    for task in options.tasks:
        for convention in options.conventions:
            for measure, sizes in (
                (_measured_native, options.native), (_measured_on_device, options.num_envs)
            ):  # fmt: skip
                for num_envs in sizes:
                    row = {'task': task, 'convention': convention, 'num_envs': num_envs}
                    row |= measure(task, convention, num_envs, options)
                    print(' | '.join(_cells(row)), flush=True)
                    yield row


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    """Returns a row of the table."""
    return (
        row['task'],
        row['convention'],
        row['batch'],
        f'{row["num_envs"]:,}',
        f'{row["steps_per_second"]:,.0f}',
        '' if row['memory'] is None else f'{row["memory"] / 2**30:.2f} GiB',
        f'{row["first_step"]:.1f} s',
    )


def page(measured: dict[str, Any]) -> str:
    """Returns the table, and what it was measured with."""
    table = markdown.table(_HEADER, [_cells(row) for row in measured['rows']])
    return f'{table}\n\nMeasured on {measured["machine"]}.'


def main(arguments: list[str] | None = None) -> None:
    """Measures and prints, and writes the figures."""
    options = _parse(arguments)
    if options.read:
        measured = json.loads(options.read.read_text(encoding='utf-8'))
    else:
        wp.init()
        measured = {'machine': _machine(), 'rows': []}
        for row in _measure(options):
            measured['rows'].append(row)
            if options.output:  # After each row: some take minutes.
                options.output.write_text(json.dumps(measured, indent=1), encoding='utf-8')
    if options.write:
        markdown.write_between_markers(options.write, _MARKER, page(measured))


def _machine() -> str:
    return (
        f'{num_processors()} processors'
        f' ({platform.system()}, {platform.machine()}), mujoco-warp {mujoco_warp.__version__}, '
        f'warp-lang {wp.__version__}'
    )


if __name__ == '__main__':
    main()
