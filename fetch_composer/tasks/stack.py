"""Stack: put one block at a place on the table, and another one on top of it."""

from collections.abc import Sequence

import numpy as np
from dm_control.composer import variation

from fetch_composer import entities
from fetch_composer.tasks import goal_task, registry, samplers, tabletop
from fetch_composer.tasks.options import TaskOptions

# Blocks start, and the stack is to be, up to this many m from the gripper along x and along y ...
_RANGE = 0.15
# ... blocks no nearer to the gripper than this ...
_BLOCK_CLEARANCE = 0.1
# ... and blocks this many m apart, and the upper one so far from the stack, so that fingers fit
# between them.
_APART = 0.12


@registry.register('stack')
class Stack(goal_task.GoalTask):
    """Bring the first block to its goal on the table, and put the second one on top of it."""

    instruction = 'put the green block on its mark and the orange one on top of it'

    def __init__(self, options: TaskOptions = tabletop.LONG_EPISODES) -> None:
        """Initializes the task."""
        blocks = tabletop.two_blocks(options, ('lower_block', 'upper_block'))
        super().__init__(options, tabletop.WORKSPACE, blocks, locked_gripper=False)

    def _build_samplers(self):
        place = samplers.OffsetBeyond(self.grip_start, _RANGE, _BLOCK_CLEARANCE)
        goal = samplers.GoalAround(self.grip_start, _RANGE, self.object_height)
        return (
            samplers.Apart(place, len(self.scene.objects), _APART),
            _OneOnTheOther(samplers.Apart(goal, 1, _APART), self.scene.objects),
        )

    def _raised_goal(self, goal, raised):
        lower, upper = raised
        return super()._raised_goal(goal, np.array((lower, 2 * lower + upper)))


class _OneOnTheOther(variation.Variation):
    """The goals of two blocks: a place on the table, and the one on top of it."""

    def __init__(self, sampler: variation.Variation, blocks: Sequence[entities.Block]) -> None:
        self._sampler = sampler
        self._blocks = blocks

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (6,) in m."""
        del current_value  # Unused.
        lower = self._sampler(initial_value=initial_value, random_state=random_state)
        raised = sum(each.half_height for each in self._blocks)
        return np.concatenate((lower, lower + (0.0, 0.0, raised)))
