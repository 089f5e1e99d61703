"""Pushes the block to its goal by planning: no policy, no learning, only the batch.

    python examples/planning.py --episodes 3 --seed 0

At every step a cross-entropy planner tries many plans from the present state, each in an
environment of the batch, and plays the first action of what the best of them have in common.
"""

import argparse
import time

import numpy as np

import fetch_composer

_PLANS = 64
_ELITE = 8
_ROUNDS = 2
_KNOTS, _HELD = 5, 3  # A plan is 5 actions, each held for 3 control steps.
_BEHIND = 0.06  # m from the block's centre to where a push begins.
_PUSHING_HEIGHT = 0.425  # m


def cost(observation) -> np.ndarray:
    """Returns how far things are from being pushed: (n,), in m."""
    block, goal = observation['achieved_goal'], observation['desired_goal']
    gripper = observation['observation'][:, :3]
    to_goal = goal - block
    left = np.linalg.norm(to_goal, axis=1)
    behind = block - _BEHIND * to_goal / np.maximum(left, 0.01)[:, np.newaxis]
    behind[:, 2] = _PUSHING_HEIGHT
    away = np.linalg.norm(gripper - behind, axis=1)
    return left + np.where(left < 0.03, 0.0, 0.3 * away)


def plan(batch, state, mean, rng) -> np.ndarray:
    """Returns a plan, (knots, 4), that is better than `mean`."""
    deviation = np.full_like(mean, 0.6)
    for _ in range(_ROUNDS):
        plans = np.clip(mean + deviation * rng.standard_normal((_PLANS, *mean.shape)), -1, 1)
        plans[0] = mean
        batch.set_states([state] * _PLANS)
        total = np.zeros(_PLANS)
        for knot in range(_KNOTS):
            for _ in range(_HELD):
                total += cost(batch.step(plans[:, knot]).observation)
        best = plans[np.argsort(total)[:_ELITE]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.05
    return mean


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--episodes', type=int, default=3)
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    env = fetch_composer.load('push')
    # Futures may go on beyond the episode's end.
    batch = fetch_composer.BatchEnvironment('push', _PLANS, seed=0, max_episode_steps=None)
    reached, seconds = 0, []
    for seed in range(arguments.seed, arguments.seed + arguments.episodes):
        rng = np.random.default_rng(seed)
        env.seed(seed)
        time_step, mean = env.reset(), np.zeros((_KNOTS, 4))
        while not time_step.last():
            started = time.perf_counter()
            mean = plan(batch, env.get_state(), mean, rng)
            seconds.append(time.perf_counter() - started)
            time_step = env.step(mean[0])
        reached += env.task.is_success()
        print(f'seed {seed}: {"at the goal" if env.task.is_success() else "elsewhere"}', flush=True)
    print(f'{reached} of {arguments.episodes} at the goal; {np.mean(seconds):.2f} s a decision')


if __name__ == '__main__':
    main()
