"""How episodes of a task start and end, as the device has it."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from fetch_composer import tasks
from fetch_composer.tasks import rewards, samplers
from fetch_composer.tasks.options import TaskOptions
from fetch_composer.warp_batch import structs

# Options that a device has no part in.
_OPTIONS = (
    'reward_type', 'max_episode_steps', 'terminate_on_success', 'convention', 'object_position',
    'goal',
)  # fmt: skip


def check_options(options: TaskOptions, usual: TaskOptions) -> None:
    """Raises `ValueError` if options were chosen that the device does not have.

    Args:
        options: What was chosen.
        usual: The options of the task if nothing is.
    """
    for name in vars(usual):
        if name not in _OPTIONS and getattr(options, name) != getattr(usual, name):
            raise ValueError(
                f'WarpBatchEnvironment has no {name} but the usual one; what may be chosen is '
                f'{", ".join(_OPTIONS)}. BatchEnvironment has all options.'
            )


def of(task: tasks.GoalTask) -> structs.Rules:
    """Returns the rules of a task.

    Raises:
        ValueError: if it has several objects, or draws starts or goals in a way of its own.
    """
    places, goals = task.starts.samplers
    if (
        len(task.scene.objects) > 1
        or task.scene.obstacles
        or task.scene.props
        or type(places) not in (samplers.OffsetBeyond, type(None))
        or type(goals) is not samplers.GoalAround
    ):
        raise ValueError(
            f'WarpBatchEnvironment does not have the task {task.name!r}: it draws starts on the '
            'device, for tasks with at most one object, and neither obstacles nor props, whose '
            'samplers are samplers.OffsetBeyond and samplers.GoalAround. BatchEnvironment has it.'
        )
    options = task.options
    rules = structs.Rules()
    rules.usual_goal = wp.vec3(*_or_nan(options.goal, 3))
    rules.usual_place = wp.vec2(*_or_nan(options.object_position, 2))
    centre, half_range = goals.centre.copy(), np.full(3, goals.half_range)
    if goals.height is not None:
        centre[2], half_range[2] = goals.height, 0.0
    rules.goal_centre, rules.goal_range = wp.vec3(*centre), wp.vec3(*half_range)
    rules.air_probability, rules.air_height = goals.air_probability, goals.air_height
    if places is not None:
        rules.object_centre = wp.vec2(*places.centre)
        rules.object_range, rules.object_clearance = places.half_range, places.clearance
    rules.limit = options.max_episode_steps or 0
    rules.ends_at_goal = options.terminate_on_success
    rules.is_dense = options.reward_type == 'dense'
    rules.threshold = rewards.DISTANCE_THRESHOLD
    return rules


def _or_nan(place: Sequence[float] | None, size: int) -> np.ndarray:
    return np.full(size, np.nan) if place is None else np.array(place, dtype=np.float64)
