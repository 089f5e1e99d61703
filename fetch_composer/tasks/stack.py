"""Stack: put one block at a place on the table, and another one on top of it."""

import numpy as np
from dm_control.composer import variation

from fetch_composer import entities
from fetch_composer.tasks import goal_task, registry, samplers, scene
from fetch_composer.tasks.options import TaskOptions

_WORKSPACE = scene.Workspace(
    robot_position=(0.405, 0.48, 0.0),
    gripper_position=(1.3419, 0.7491, 0.555),
    table_position=(1.3, 0.75, 0.2),
    table_half_size=(0.25, 0.35, 0.2),
)

_BLOCK_HALF_SIZE = (0.025, 0.025, 0.025)  # m
_BLOCK_MASS = 2.0  # kg
_COLORS = {'lower': (0.1, 0.5, 0.32, 1.0), 'upper': (0.85, 0.55, 0.1, 1.0)}

# Blocks start, and the stack is to be, up to this many m from the gripper along x and along y ...
_RANGE = 0.15
# ... blocks no nearer to the gripper than this ...
_BLOCK_CLEARANCE = 0.1
# ... and blocks this many m apart, and the upper one so far from the stack, so that fingers fit
# between them.
_APART = 0.12

_EPISODE_STEPS = 100


@registry.register('stack')
class Stack(goal_task.GoalTask):
    """Bring the first block to its goal on the table, and put the second one on top of it."""

    instruction = 'put the green block on its mark and the orange one on top of it'

    def __init__(
        self, options: TaskOptions = TaskOptions(max_episode_steps=_EPISODE_STEPS)
    ) -> None:
        """Initializes the task."""
        blocks = [
            entities.Block(
                size=_BLOCK_HALF_SIZE,
                mass=_BLOCK_MASS,
                quaternion=options.object_quaternion,
                rgba=rgba,
                name=f'{which}_block',
            )
            for which, rgba in _COLORS.items()
        ]
        super().__init__(options, _WORKSPACE, blocks, locked_gripper=False)

    def _build_samplers(self):
        place = samplers.OffsetBeyond(self.grip_start, _RANGE, _BLOCK_CLEARANCE)
        goal = samplers.GoalAround(self.grip_start, _RANGE, self.object_height)
        return (
            samplers.Apart(place, len(self.scene.objects), _APART),
            _OneOnTheOther(samplers.Apart(goal, 1, _APART)),
        )


class _OneOnTheOther(variation.Variation):
    """The goals of two blocks: a place on the table, and the one on top of it."""

    def __init__(self, sampler: variation.Variation) -> None:
        self._sampler = sampler

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (6,) in m."""
        del current_value  # Unused.
        lower = self._sampler(initial_value=initial_value, random_state=random_state)
        return np.concatenate((lower, lower + (0.0, 0.0, 2 * _BLOCK_HALF_SIZE[2])))
