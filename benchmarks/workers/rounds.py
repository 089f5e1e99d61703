"""Rounds of control steps, and the actions that every worker takes in them."""

import time
from collections.abc import Callable, Sequence

import numpy as np

EPISODE_STEPS = 50
ACTION_SIZE = 4


def episode_actions(episode: int, num_envs: int | None = None) -> np.ndarray:
    """Returns uniform random actions of an episode, the same in every worker.

    Args:
        episode: Number of the episode, which seeds them.
        num_envs: How many environments take them; None for a single one.

    Returns:
        (50, 4) or (50, num_envs, 4) float32 in [-1, 1].
    """
    batch_shape = () if num_envs is None else (num_envs,)
    shape = (EPISODE_STEPS, *batch_shape, ACTION_SIZE)
    return np.random.default_rng(episode).uniform(-1, 1, shape).astype(np.float32)


class Stepping:
    """Times control steps, and resets if asked for.

    Otherwise episodes start in between, where the clock stands still.
    """

    def __init__(
        self,
        start_episode: Callable[[int], Sequence],
        step: Callable,
        num_steps: int,
        num_envs: int = 1,
        reset: Callable[[], object] | None = None,
    ) -> None:
        """Initializes the rounds.

        Args:
            start_episode: Called with an episode's number; returns the inputs of its steps.
            step: Called with one input after another.
            num_steps: Calls of `step` in one round.
            num_envs: How many environments a call advances.
            reset: What is timed as a reset, once an episode has been started; None for none.
        """
        self._reset = reset
        self._start_episode = start_episode
        self._step = step
        self._num_steps = num_steps
        self._num_envs = num_envs
        self._episode = 0
        self._inputs: Sequence = ()
        self._next = 0

    def __call__(self) -> float:
        """Returns the seconds that one control step of one environment took in this round."""
        step, left, seconds = self._step, self._num_steps, 0.0
        while left:
            if self._next == len(self._inputs):
                self._inputs = list(self._start_episode(self._episode))
                self._episode += 1
                self._next = 0
                if self._reset is not None:
                    begin = time.perf_counter()
                    self._reset()
                    seconds += time.perf_counter() - begin
            inputs = self._inputs[self._next : self._next + left]
            begin = time.perf_counter()
            for each in inputs:
                step(each)
            seconds += time.perf_counter() - begin
            left -= len(inputs)
            self._next += len(inputs)
        return seconds / (self._num_steps * self._num_envs)


class Repeating:
    """Times one and the same call."""

    def __init__(self, call: Callable[[], object], num_calls: int) -> None:
        """Initializes the rounds.

        Args:
            call: What is timed.
            num_calls: How often it is called in one round.
        """
        self._call = call
        self._num_calls = num_calls

    def __call__(self) -> float:
        """Returns the seconds that one call took in this round."""
        call = self._call
        begin = time.perf_counter()
        for _ in range(self._num_calls):
            call()
        return (time.perf_counter() - begin) / self._num_calls
