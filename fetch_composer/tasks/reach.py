"""Reach: move the gripper to a place in the air."""

from fetch_composer.tasks import conventions, goal_task, registry, samplers, scene, settled
from fetch_composer.tasks.options import TaskOptions

_WORKSPACE = scene.Workspace(
    robot_position=(0.4049, 0.48, 0.0),
    gripper_position=(1.3419, 0.7491, 0.555),
    table_position=(1.3, 0.75, 0.2),
    table_half_size=(0.25, 0.35, 0.2),
)

# The goal lies up to this many m from the gripper along each axis.
_GOAL_RANGE = 0.15


@registry.register('reach')
class Reach(goal_task.GoalTask):
    """Bring the gripper to its goal; there is no object, and the gripper is locked."""

    conventions = tuple(conventions.CONVENTIONS)
    instruction = 'move the gripper to the red mark'

    def __init__(self, options: TaskOptions = TaskOptions()) -> None:
        """Initializes the task."""
        super().__init__(options, _WORKSPACE, settled=settled.load('reach'))

    def _build_samplers(self):
        return None, samplers.GoalAround(self.grip_start, _GOAL_RANGE)
