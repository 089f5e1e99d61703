"""Runs the policies that ship in Gymnasium-Robotics' own tasks, beside ours on the same seeds.

    make transfer
    python -m benchmarks.transfer --peer PYTHON [--tasks push ...] [--seeds 1000000 1000499]

Gymnasium-Robotics runs in an interpreter of its own, on the same MuJoCo, and has never met the
policies: they were trained in `gymnasium_robotics`, which reproduces it.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import gymnasium
import numpy as np

import fetch_composer
from benchmarks import markdown
from fetch_composer import gymnasium_ids, policies, tasks
from fetch_composer.explorer.results import statistics
from fetch_composer.policies.files import trained

_WORKER = pathlib.Path(__file__).parent / 'workers' / 'robotics_policy.py'
_CONVENTION = 'gymnasium_robotics'
_CLOSE = 0.02  # What the two may differ by.
_COLUMNS = ('task', 'here', "in Gymnasium-Robotics' own", 'difference', 'episodes that end alike')
_TABLE = 'transfer table: made by make transfer'


def _context(task: str) -> policies.PolicyContext:
    with fetch_composer.load(task, convention=_CONVENTION) as env:
        return policies.PolicyContext.of(env)


def _run_here(context: policies.PolicyContext, seeds: range) -> np.ndarray:
    """Returns whether the episode of each seed ends at its goal, as Gymnasium seeds it."""
    env = gymnasium.make(gymnasium_ids.env_id(context.task_name, _CONVENTION))
    policy = policies.load('trained', context)
    successes = []
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        policy.reset()
        is_over = False
        while not is_over:
            observation, _, terminated, truncated, info = env.step(policy(observation))
            is_over = terminated or truncated
        successes.append(bool(info['is_success']))
    env.close()
    return np.array(successes)


def _run_there(peer: str, context: policies.PolicyContext, seeds: range) -> np.ndarray:
    places = [context.task_name, trained.path(context), str(seeds[0]), str(seeds[-1])]
    done = subprocess.run(
        [peer, str(_WORKER), *places], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    return np.array(json.loads(done.stdout.splitlines()[-1]))


def _cell(successes: np.ndarray) -> str:
    rate = statistics.success_rate(successes)
    return f'{rate.value:.3f} ({rate.low:.3f} to {rate.high:.3f})'


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--peer', required=True, help="the peer's Python interpreter")
    parser.add_argument('--tasks', nargs='+', default=tasks.published())
    parser.add_argument('--seeds', nargs=2, type=int, default=(1_000_000, 1_000_499))
    parser.add_argument('--write', type=pathlib.Path, metavar='PAGE', help='put the table there')
    arguments = parser.parse_args()
    first, last = arguments.seeds
    seeds = range(first, last + 1)
    rows, differences = [], []
    for task in arguments.tasks:
        print(task, file=sys.stderr, flush=True)
        context = _context(task)
        here, there = _run_here(context, seeds), _run_there(arguments.peer, context, seeds)
        differences.append(there.mean() - here.mean())
        alike = (here == there).mean()
        rows.append((task, _cell(here), _cell(there), f'{differences[-1]:+.3f}', f'{alike:.1%}'))
    table = markdown.table(_COLUMNS, rows)
    print(table)
    if arguments.write is not None:
        markdown.write_between_markers(arguments.write, _TABLE, table)
    return int(max(map(abs, differences)) > _CLOSE)


if __name__ == '__main__':
    sys.exit(main())
