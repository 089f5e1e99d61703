"""Push: move a block to a place on the table with a closed gripper."""

from fetch_composer import entities
from fetch_composer.tasks import conventions, goal_task, registry, samplers, scene, settled
from fetch_composer.tasks.options import TaskOptions

_WORKSPACE = scene.Workspace(
    robot_position=(0.405, 0.48, 0.0),
    gripper_position=(1.3419, 0.7491, 0.555),
    table_position=(1.3, 0.75, 0.2),
    table_half_size=(0.25, 0.35, 0.2),
)

_BLOCK_HALF_SIZE = (0.025, 0.025, 0.025)  # m
_BLOCK_MASS = 2.0  # kg

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
        block = entities.Block(
            size=_BLOCK_HALF_SIZE, mass=_BLOCK_MASS, quaternion=options.object_quaternion
        )
        super().__init__(options, _WORKSPACE, (block,), settled=settled.load('push'))

    def _build_samplers(self):
        return (
            samplers.OffsetBeyond(self.grip_start, _BLOCK_RANGE, _BLOCK_CLEARANCE),
            samplers.GoalAround(self.grip_start, _GOAL_RANGE, self.object_height),
        )
