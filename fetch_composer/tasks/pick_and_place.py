"""Pick and place: bring a block to a place on the table or in the air."""

from fetch_composer.tasks import conventions, goal_task, registry, samplers, settled, tabletop
from fetch_composer.tasks.options import TaskOptions

# The block starts, and its goal lies, up to this many m from the gripper along x and along y ...
_BLOCK_RANGE = 0.15
_GOAL_RANGE = 0.15
# ... and the block no nearer to the gripper than this.
_BLOCK_CLEARANCE = 0.1

# This share of goals is lifted off the table, by up to this many m.
_AIR_PROBABILITY = 0.5
_AIR_HEIGHT = 0.45


@registry.register('pick_and_place')
class PickAndPlace(goal_task.GoalTask):
    """Grasp a block and bring it to its goal; the fourth action opens and closes the gripper."""

    conventions = tuple(conventions.CONVENTIONS)
    instruction = 'pick up the block and bring it to the red mark'

    def __init__(self, options: TaskOptions = TaskOptions()) -> None:
        """Initializes the task."""
        block = tabletop.block(options)
        super().__init__(
            options,
            tabletop.WORKSPACE,
            (block,),
            locked_gripper=False,
            settled=settled.load('pick_and_place'),
        )

    def _build_samplers(self):
        return (
            samplers.OffsetBeyond(self.grip_start, _BLOCK_RANGE, _BLOCK_CLEARANCE),
            samplers.GoalAround(
                self.grip_start, _GOAL_RANGE, self.object_height, _AIR_PROBABILITY, _AIR_HEIGHT
            ),
        )
