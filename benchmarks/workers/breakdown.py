"""Where the time of a control step goes."""

import collections
import contextlib
import time
from collections.abc import Iterator
from typing import Any

import mujoco
import mujoco.batch

import fetch_composer
from benchmarks.workers import protocol, rounds
from fetch_composer.tasks import action_modes, goal_task, observation, rewards

# What is timed: owner, attribute, and the part of a control step that it is.
_SINGLE_PARTS = (
    (goal_task.GoalTask, 'before_step', 'validation, action'),
    (mujoco, 'mj_step', 'physics'),
    (goal_task.GoalTask, 'after_step', 'refresh of kinematics'),
    (observation.GoalObserver, 'observation', 'observation'),
    (observation.GoalObserver, 'achieved_goal', 'observation'),
    (goal_task.GoalTask, 'get_reward', 'reward, termination'),
    (goal_task.GoalTask, 'should_terminate_episode', 'reward, termination'),
)
_BATCH_PARTS = (
    (action_modes.ActionMode, 'clip', 'validation, action'),
    (mujoco.batch.Batch, 'step', 'physics, refresh of kinematics'),
    (mujoco.batch.Batch, 'forward', 'physics, refresh of kinematics'),
    (observation.BatchObserver, 'observation', 'observation'),
    (observation.BatchObserver, 'achieved_goal', 'observation'),
    (rewards, 'compute_reward', 'reward, termination'),
)
_REST = 'Composer, time step'


class _Stopwatch:
    """Adds up the time within functions; one that another calls counts as the caller's."""

    def __init__(self, parts) -> None:
        self._parts = parts
        self._running = False
        self.seconds: dict[str, float] = collections.defaultdict(float)

    def _timed(self, function, part: str):
        seconds, clock = self.seconds, time.perf_counter

        def call(*args, **kwargs):
            if self._running:
                return function(*args, **kwargs)
            self._running = True
            begin = clock()
            try:
                return function(*args, **kwargs)
            finally:
                seconds[part] += clock() - begin
                self._running = False

        return call

    @contextlib.contextmanager
    def attached(self) -> Iterator[None]:
        """Times the functions while the context lasts."""
        originals = [getattr(owner, name) for owner, name, _ in self._parts]
        self.seconds.clear()
        for (owner, name, part), original in zip(self._parts, originals, strict=True):
            setattr(owner, name, self._timed(original, part))
        try:
            yield
        finally:
            for (owner, name, _), original in zip(self._parts, originals, strict=True):
                setattr(owner, name, original)


def build(convention: str, num_envs: int | None = None, num_threads: int = 1):
    """Returns what measures one round.

    Its results are the microseconds, of a control step of one environment, that each part and
    the whole took in an episode. The stopwatches themselves, some 2 µs, are in the rest.

    Args:
        convention: 'documented' or 'gymnasium_robotics'.
        num_envs: How many environments; None for a single one rather than a batch.
        num_threads: How many threads share a batch.
    """
    env: Any  # Both kinds step, reset and seed alike.
    if num_envs is None:
        env = fetch_composer.load('push', seed=0, convention=convention)
        parts: tuple = _SINGLE_PARTS
    else:
        env = fetch_composer.BatchEnvironment(
            'push', num_envs, num_threads, seed=0, convention=convention
        )
        parts = _BATCH_PARTS
    stopwatch = _Stopwatch(parts)
    # The last step of an episode is left out, so that none of them is a reset.
    inputs = rounds.episode_actions(0, num_envs)[:-1]

    def start_episode(episode: int):
        env.seed(episode * (num_envs or 1))
        env.reset()
        stopwatch.seconds.clear()  # Of the reset, which the whole does not include.
        return inputs

    episode_steps = rounds.Stepping(start_episode, env.step, len(inputs), num_envs or 1)
    microseconds = 1e6 / len(inputs) / (num_envs or 1)

    def measure() -> dict[str, float]:
        with stopwatch.attached():
            whole = episode_steps() * 1e6
        spent = {part: 0.0 for _, _, part in parts}
        spent.update({part: s * microseconds for part, s in stopwatch.seconds.items()})
        return {**spent, _REST: whole - sum(spent.values()), 'whole': whole}

    return measure


if __name__ == '__main__':
    protocol.serve(build)
