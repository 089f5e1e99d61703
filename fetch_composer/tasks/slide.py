"""Slide: hit a puck so that it comes to rest at a goal beyond the robot's reach."""

import numpy as np

from fetch_composer import entities
from fetch_composer.tasks import conventions, goal_task, registry, samplers, scene, settled
from fetch_composer.tasks.options import TaskOptions

# Low enough for the puck to slide on: sliding, torsional and rolling coefficients.
_FRICTION = (0.1, 0.005, 0.0001)

_WORKSPACE = scene.Workspace(
    robot_position=(0.05, 0.48, 0.0),
    gripper_position=(1.013, 0.7492, 0.555),
    table_position=(1.32441906, 0.75018422, 0.2),
    table_half_size=(0.625, 0.45, 0.2),
    table_friction=_FRICTION,
)

_PUCK_SIZE = (0.025, 0.02)  # Radius and half of the height in m.
_PUCK_MASS = 2.0  # kg

# The puck starts up to this many m from the gripper along x and along y ...
_PUCK_RANGE = 0.1
# ... but no nearer than this.
_PUCK_CLEARANCE = 0.1
# The goal lies up to this many m from a point ahead of the gripper.
_GOAL_RANGE = 0.3
_GOAL_OFFSET = np.array((0.4, 0.0, 0.0))  # m


@registry.register('slide')
class Slide(goal_task.GoalTask):
    """Slide a puck to its goal on a long slippery table; the gripper is locked."""

    conventions = tuple(conventions.CONVENTIONS)
    instruction = 'slide the puck to the red mark'

    def __init__(self, options: TaskOptions = TaskOptions()) -> None:
        """Initializes the task."""
        puck = entities.Block(
            geom_type='cylinder',
            size=_PUCK_SIZE,
            mass=_PUCK_MASS,
            friction=_FRICTION,
            quaternion=options.object_quaternion,
        )
        super().__init__(options, _WORKSPACE, (puck,), settled=settled.load('slide'))

    def _build_samplers(self):
        return (
            samplers.OffsetBeyond(self.grip_start, _PUCK_RANGE, _PUCK_CLEARANCE),
            samplers.GoalAround(self.grip_start + _GOAL_OFFSET, _GOAL_RANGE, self.object_height),
        )
