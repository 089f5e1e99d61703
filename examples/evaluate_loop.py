"""Improves a small policy by trial and error, and says now and then how well it does.

python examples/evaluate_loop.py
"""

import argparse

import numpy as np

from fetch_composer import explorer

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--task', default='reach')
parser.add_argument('--rounds', type=int, default=30)


def policy_of(gains: np.ndarray):
    """Returns a policy that acts for many environments at once: gains (3, 3) on the way to go."""

    def act(observations):
        way = observations['desired_goal'] - observations['achieved_goal']
        return np.clip(np.pad(way @ gains, ((0, 0), (0, 1))), -1, 1).astype(np.float32)

    return act


def main(args: argparse.Namespace) -> None:
    generator = np.random.default_rng(0)
    best, best_distance = np.zeros((3, 3)), np.inf
    for i in range(args.rounds):
        gains = best + generator.normal(size=(3, 3))
        tried = explorer.evaluate(policy_of(gains), args.task, seeds=range(32), vectorized=True)
        if tried.final_distance.value < best_distance:
            best, best_distance = gains, tried.final_distance.value
        if i % 10 == 9:  # On seeds that nothing was tried on.
            result = explorer.evaluate(policy_of(best), args.task, vectorized=True)
            print(
                f'round {i + 1}: success {result.success_rate.value:.2f} '
                f'({result.success_rate.low:.2f} to {result.success_rate.high:.2f}), '
                f'{100 * result.final_distance.value:.1f} cm from the goal',
                flush=True,
            )


if __name__ == '__main__':
    main(parser.parse_args())
