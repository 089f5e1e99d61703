"""Compares `gymnasium_robotics` with Gymnasium-Robotics itself, both live on the same seeds.

    make parity
    python -m benchmarks.parity --peer PYTHON [--tasks push ...] [--seeds 3000 3099] [--write PAGE]

Gymnasium-Robotics runs in an interpreter of its own, on the same MuJoCo. An episode's error is the
largest distance, over its 50 steps, between where the two simulators have the gripper, or the
object. How near one can come is told by Gymnasium-Robotics against itself, with one joint of the
arm started 1e-15 rad aside.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import fetch_composer
from benchmarks import markdown
from fetch_composer import tasks

_WORKER = pathlib.Path(__file__).parent / 'workers' / 'robotics_episodes.py'
_OUTPUT = pathlib.Path('build') / 'parity' / 'results.json'
_KINDS = ('uniform', 'seeking')
_QUANTILES = (0.5, 0.75, 0.9)
_CLOSE = 1e-5  # m
# What is to be reached: (kind, what is compared) -> (quantile, m).
_GOALS = {
    ('uniform', 'gripper'): (0.97, 1e-5),
    ('uniform', 'achieved_goal'): (0.97, 1e-5),
    ('seeking', 'gripper'): (0.5, 1e-3),
    ('seeking', 'achieved_goal'): (0.5, 1e-3),
}
# Slide's puck is chaotic, and the gripper that touches it feels it.
_GOALS_OF_SLIDE = {
    ('uniform', 'gripper'): (0.9, 1e-5),
    ('uniform', 'achieved_goal'): (0.9, 2e-3),
    ('seeking', 'gripper'): (0.5, 1e-3),
    ('seeking', 'achieved_goal'): (0.5, 5e-2),
}
_COLUMNS = ('task, actions', '', 'median', '75 %', '90 %', 'within 1e-5 m', 'itself, nudged',
            'goal', 'reached', 'rewards equal')  # fmt: skip
_TABLE = 'parity table: made by make parity'


def _record_peer(peer: str, task: str, kind: str, seeds: tuple[int, int]) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        output = pathlib.Path(folder) / 'episodes.npz'
        first, last = map(str, seeds)
        command = [peer, str(_WORKER), task, kind, first, last, str(output)]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        with np.load(output) as recorded:
            return dict(recorded)


def compare(task: str, peer_episodes: dict) -> dict[str, np.ndarray]:
    """Returns the errors of episodes that are run with the peer's seeds and actions.

    Args:
        task: Name of the task.
        peer_episodes: `seed` (E,), `actions` (E, T, 4), `gripper` and `achieved_goal`
            (E, T + 1, 3) in m, the same with the prefix `nudged_`, and `reward` (E, T).

    Returns:
        `gripper` and `achieved_goal`: (E,) largest distances in m; `nudged_gripper` and
        `nudged_achieved_goal`: the same between the peer and the peer nudged; `reward`: (E, T)
        whether rewards are equal.
    """
    env = fetch_composer.load(task, convention='gymnasium_robotics')
    errors: dict[str, list] = {'gripper': [], 'achieved_goal': [], 'reward': []}
    for episode, seed in enumerate(peer_episodes['seed']):
        env.seed(int(seed))
        time_steps = [env.reset()]
        time_steps += [env.step(action) for action in peer_episodes['actions'][episode]]
        ours = {
            'gripper': [t.observation['observation'][:3] for t in time_steps],
            'achieved_goal': [t.observation['achieved_goal'] for t in time_steps],
        }
        for name, places in ours.items():
            errors[name].append(_error(np.array(places), peer_episodes[name][episode]))
        rewards = np.array([t.reward for t in time_steps[1:]])
        errors['reward'].append(rewards == peer_episodes['reward'][episode])
    env.close()
    for name in ('gripper', 'achieved_goal'):
        nudged = f'nudged_{name}'
        errors[nudged] = list(map(_error, peer_episodes[nudged], peer_episodes[name]))
    return {name: np.array(values) for name, values in errors.items()}


def _error(places: np.ndarray, others: np.ndarray) -> float:
    return float(np.linalg.norm(places - others, axis=1).max())


def _summary(errors: dict[str, np.ndarray], task: str, kind: str) -> dict:
    goals = _GOALS_OF_SLIDE if task == 'slide' else _GOALS
    summary: dict = {'rewards_equal': float(errors['reward'].mean())}
    for name in ('gripper', 'achieved_goal'):
        quantile, limit = goals[kind, name]
        summary[name] = {
            'quantiles': {str(q): float(np.quantile(errors[name], q)) for q in _QUANTILES},
            'share_within_1e-5': float((errors[name] <= _CLOSE).mean()),
            'share_of_itself_within_1e-5': float((errors[f'nudged_{name}'] <= _CLOSE).mean()),
            'goal': {'quantile': quantile, 'metres': limit},
            'reached': bool(np.quantile(errors[name], quantile) <= limit),
        }
    return summary


def _rows(task: str, kind: str, summary: dict) -> list[tuple[str, ...]]:
    rows = []
    for name, what in (('gripper', 'gripper'), ('achieved_goal', 'object')):
        if task == 'reach' and what == 'object':
            continue
        row, goal = summary[name], summary[name]['goal']
        cells = (
            f'{task}, {kind}',
            what,
            *(f'{q:.1e}' for q in row['quantiles'].values()),
            f'{row["share_within_1e-5"]:.0%}',
            f'{row["share_of_itself_within_1e-5"]:.0%}',
            f'{goal["quantile"]:.0%} ≤ {goal["metres"]:.0e} m',
            'yes' if row['reached'] else 'no',
            f'{summary["rewards_equal"]:.2%}',
        )
        rows.append(cells)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--peer', required=True, help="the peer's Python interpreter")
    parser.add_argument('--tasks', nargs='+', default=tasks.published())
    parser.add_argument('--seeds', nargs=2, type=int, default=(3000, 3099))
    parser.add_argument(
        '--write',
        type=pathlib.Path,
        metavar='PAGE',
        help=f'put the table of all tasks on a page, below the line <!-- {_TABLE} -->',
    )
    arguments = parser.parse_args()
    page = arguments.write
    if page is not None and not (page.is_file() and markdown.has_markers(page, _TABLE)):
        parser.error(f'{page} has no place for the table: a line <!-- {_TABLE} --> and an end.')
    results: dict = {'seeds': arguments.seeds, 'tasks': {}}
    rows: list[tuple[str, ...]] = []
    for task in arguments.tasks:
        for kind in _KINDS:
            print(f'{task}, {kind}', file=sys.stderr, flush=True)
            peer_episodes = _record_peer(arguments.peer, task, kind, arguments.seeds)
            summary = _summary(compare(task, peer_episodes), task, kind)
            results['tasks'].setdefault(task, {})[kind] = summary
            rows += _rows(task, kind, summary)
    table = markdown.table(_COLUMNS, rows)
    print(table)
    _OUTPUT.parent.mkdir(parents=True, exist_ok=True)
    _OUTPUT.write_text(json.dumps(results, indent=2))
    written = [_OUTPUT]
    if page is not None and set(arguments.tasks) >= set(tasks.published()):
        markdown.write_between_markers(page, _TABLE, table)
        written.append(page)
    elif page is not None:
        print(f'Left as it was, for want of some tasks: {page}')
    print(f'\nWritten: {", ".join(map(str, written))}')


if __name__ == '__main__':
    main()
