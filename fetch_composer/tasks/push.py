"""Push: move a block to a place on the table with a closed gripper."""

from fetch_composer.tasks import conventions, goal_task, registry, samplers, settled, tabletop
from fetch_composer.tasks.options import TaskOptions

# The block starts, and its goal lies, up to this many m from the gripper along x and along y ...
_BLOCK_RANGE = 0.15
_GOAL_RANGE = 0.15
# ... and the block no nearer to the gripper than this.
_BLOCK_CLEARANCE = 0.1


@registry.register('push')
class Push(goal_task.GoalTask):
    """Push a block to its goal on the table; the gripper is locked in its closed position."""

    conventions = tuple(conventions.CONVENTIONS)
    instruction = 'push the block to the red mark'

    def __init__(self, options: TaskOptions = TaskOptions()) -> None:
        """Initializes the task."""
        block = tabletop.block(options)
        super().__init__(options, tabletop.WORKSPACE, (block,), settled=settled.load('push'))

    def _build_samplers(self):
        return (
            samplers.OffsetBeyond(self.grip_start, _BLOCK_RANGE, _BLOCK_CLEARANCE),
            samplers.GoalAround(self.grip_start, _GOAL_RANGE, self.object_height),
        )
