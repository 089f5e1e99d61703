"""Push two: move two blocks to two places on the table with a closed gripper."""

from fetch_composer.tasks import goal_task, registry, samplers, tabletop
from fetch_composer.tasks.options import TaskOptions

# Blocks start, and their goals lie, up to this many m from the gripper along x and along y ...
_RANGE = 0.15
# ... blocks no nearer to the gripper than this ...
_BLOCK_CLEARANCE = 0.1
# ... and blocks, goals, and a block and the other's goal at least this many m apart, so that there
# is room for the gripper between them.
_APART = 0.12


@registry.register('push_two')
class PushTwo(goal_task.GoalTask):
    """Push two blocks, each to its own goal on the table; the gripper is locked."""

    instruction = 'push each block to its mark'

    def __init__(self, options: TaskOptions = tabletop.LONG_EPISODES) -> None:
        """Initializes the task."""
        blocks = tabletop.two_blocks(options, ('first_block', 'second_block'))
        super().__init__(options, tabletop.WORKSPACE, blocks)

    def _build_samplers(self):
        place = samplers.OffsetBeyond(self.grip_start, _RANGE, _BLOCK_CLEARANCE)
        goal = samplers.GoalAround(self.grip_start, _RANGE, self.object_height)
        count = len(self.scene.objects)
        return samplers.Apart(place, count, _APART), samplers.Apart(goal, count, _APART)
