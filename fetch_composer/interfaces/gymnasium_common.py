"""What the Gymnasium adapters share: spaces, options of a reset, and functions of goals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

try:
    import gymnasium  # noqa: F401
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode  # noqa: F401
except ImportError as error:
    raise ImportError(
        "The adapters need Gymnasium 1.1 or newer: pip install 'fetch_composer[gymnasium]'."
    ) from error

from fetch_composer import tasks
from fetch_composer.tasks import camera, checks

RENDER_FPS = 25  # Control steps in a second: pictures of an episode play in real time.

_RESET_OPTIONS = ('object_position', 'goal')


def space(spec) -> spaces.Box:
    """Returns the space of one observation: pictures are bytes, all else is unbounded."""
    if spec.dtype == np.uint8:
        return spaces.Box(0, 255, spec.shape, np.uint8)
    if np.issubdtype(spec.dtype, np.integer):
        return spaces.Box(
            np.iinfo(spec.dtype).min, np.iinfo(spec.dtype).max, spec.shape, spec.dtype
        )
    return spaces.Box(-np.inf, np.inf, spec.shape, spec.dtype.type)


def spaces_of(action_spec, observation_spec) -> tuple[spaces.Box, spaces.Dict]:
    """Returns action and observation space of one environment."""
    action_space = spaces.Box(-1.0, 1.0, action_spec.shape, np.float32)
    return action_space, spaces.Dict({k: space(spec) for k, spec in observation_spec.items()})


def picture_options(width: int, height: int, supersampling: int) -> dict[str, int]:
    """Returns size and looks of the pictures that an adapter takes.

    Raises:
        ValueError: if a number is not valid.
    """
    checked = {
        'height': checks.integer('height', height, 1),
        'width': checks.integer('width', width, 1),
        'supersampling': checks.integer('supersampling', supersampling, 1),
    }
    camera.check_size(**checked)
    return checked


def check_options(options: dict[str, Any] | None, others: Sequence[str] = ()) -> dict[str, Any]:
    """Returns the options of a reset: a start and a goal.

    Args:
        options: What was given.
        others: Names of further options that are valid.

    Raises:
        ValueError: if one is unknown; the message lists the valid ones.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f'options must be a dictionary; got {checks.shown(options)}.')
    options, valid = dict(options or {}), (*_RESET_OPTIONS, *others)
    unknown = [each for each in options if each not in valid]
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(checks.shown, unknown))}; valid are {", ".join(valid)}.'
        )
    return options


class GoalFunctions:
    """Reward, termination and truncation as functions of goals, for hindsight relabelling."""

    _task_options: tasks.TaskOptions

    def compute_reward(self, achieved_goal, desired_goal, info) -> np.ndarray:
        """Returns the reward of goals of shape (..., 3 n), for n objects; float64, shape (...,)."""
        del info  # Unused.
        return tasks.compute_reward(achieved_goal, desired_goal, self._task_options.reward_type)

    def compute_terminated(self, achieved_goal, desired_goal, info):
        """Returns False, since the tasks are continuing, but with `terminate_on_success`.

        Then it is whether the goals are achieved: bool, shape (...,).
        """
        del info  # Unused.
        if not self._task_options.terminate_on_success:
            return False
        return tasks.is_success(achieved_goal, desired_goal)

    def compute_truncated(self, achieved_goal, desired_goal, info) -> bool:
        """Returns False: only the number of steps truncates an episode."""
        del achieved_goal, desired_goal, info  # Unused.
        return False


def success_info(achieved_goal, desired_goal) -> np.ndarray:
    """Returns what `info['is_success']` is: 0 or 1, float32 as in Gymnasium-Robotics, (...,)."""
    return np.float32(tasks.is_success(achieved_goal, desired_goal))
