"""Push two: move two blocks to two places on the table with a closed gripper."""

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
_COLORS = {'first': (0.1, 0.5, 0.32, 1.0), 'second': (0.85, 0.55, 0.1, 1.0)}

# Blocks start, and their goals lie, up to this many m from the gripper along x and along y ...
_RANGE = 0.15
# ... blocks no nearer to the gripper than this ...
_BLOCK_CLEARANCE = 0.1
# ... and blocks, goals, and a block and the other's goal at least this many m apart, so that there
# is room for the gripper between them.
_APART = 0.12

_EPISODE_STEPS = 100


@registry.register('push_two')
class PushTwo(goal_task.GoalTask):
    """Push two blocks, each to its own goal on the table; the gripper is locked."""

    instruction = 'push each block to its mark'

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
        super().__init__(options, _WORKSPACE, blocks)

    def _build_samplers(self):
        place = samplers.OffsetBeyond(self.grip_start, _RANGE, _BLOCK_CLEARANCE)
        goal = samplers.GoalAround(self.grip_start, _RANGE, self.object_height)
        count = len(self.scene.objects)
        return samplers.Apart(place, count, _APART), samplers.Apart(goal, count, _APART)
