"""An episode played again in a single environment, to look at it."""

from collections.abc import Callable

import numpy as np

from fetch_composer.explorer.episodes.episode import Episode

_TOLERANCE = 1e-9  # m, rad; an episode may have been run on another processor.


class ReplayError(RuntimeError):
    """An episode that was played again did not end where it had ended."""


def replay(env, episode: Episode, on_progress: Callable[[int], None] | None = None) -> None:
    """Plays an episode again, from its seed and with its actions.

    Args:
        env: An environment of the options that the episode was run with.
        episode: The episode.
        on_progress: Called after the reset and after every step, with the number of steps so far.

    Raises:
        ReplayError: if it does not end as the episode did.
    """
    on_progress = on_progress or (lambda step: None)
    env.seed(episode.seed)
    time_step = env.reset()
    on_progress(0)
    for step, action in enumerate(episode.action, start=1):
        time_step = env.step(action)
        on_progress(step)
    for name, value in time_step.observation.items():
        check(episode, episode.steps, name, value)


def check(episode: Episode, step: int, name: str, value: np.ndarray) -> None:
    """Makes sure that an observation is that of an episode.

    Raises:
        ReplayError: if it is not.
    """
    error = np.abs(value - getattr(episode, name)[step]).max()
    if not error <= _TOLERANCE:
        raise ReplayError(
            f'The episode of seed {episode.seed} was played again and ended elsewhere: '
            f'{name} differs by {error:.3g} at step {step}.'
        )
