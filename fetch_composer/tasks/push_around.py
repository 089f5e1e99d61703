"""Push around: move a block to a place behind a wall with a closed gripper."""

import numpy as np
from dm_control.composer import variation

from fetch_composer import entities
from fetch_composer.tasks import goal_task, registry, tabletop
from fetch_composer.tasks.options import TaskOptions

# The wall is a little higher than a block, which would be lifted over a lower one; the gripper
# passes over it.
WALL_HALF_SIZE = (0.08, 0.015, 0.03)  # m
WALL_CENTRE = (1.3419, 0.7491)  # x and y in m, below the gripper's start.

# Blocks start on one side of the wall, and goals lie on the other: up to this many m from its
# centre along x, and between so many along y.
_ALONG = 0.08
_BESIDE = (0.08, 0.15)


@registry.register('push_around')
class PushAround(goal_task.GoalTask):
    """Push a block around a wall to its goal; the gripper is locked, and may reach over it."""

    instruction = 'push the block around the wall to the red mark'

    def __init__(self, options: TaskOptions = tabletop.LONG_EPISODES) -> None:
        """Initializes the task."""
        block = tabletop.block(options)
        wall = entities.Obstacle(
            position=(*WALL_CENTRE, tabletop.WORKSPACE.table_top + WALL_HALF_SIZE[2]),
            half_size=WALL_HALF_SIZE,
            name='wall',
        )
        super().__init__(options, tabletop.WORKSPACE, (block,), obstacles=(wall,))

    def _build_samplers(self):
        return _BesideWall(), _BesideWall(self.object_height)


class _BesideWall(variation.Variation):
    """A place beside the wall: of a block, or of a goal on the other side."""

    def __init__(self, height: float | None = None) -> None:
        self._height = height

    def __call__(self, initial_value=None, current_value=None, random_state=None) -> np.ndarray:
        """Returns (2,) where a block starts or, for one that starts there, (3,) a goal, in m."""
        del current_value  # Unused.
        along, beside = random_state.uniform(-_ALONG, _ALONG), random_state.uniform(*_BESIDE)
        if initial_value is None:
            side = 1.0 if random_state.uniform() < 0.5 else -1.0
            return np.add(WALL_CENTRE, (along, side * beside))
        side = np.sign(WALL_CENTRE[1] - initial_value[1])
        return np.array((*np.add(WALL_CENTRE, (along, side * beside)), self._height))
