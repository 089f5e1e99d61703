"""The table of Push and its kin, and the block that is moved on it."""

from collections.abc import Sequence

from fetch_composer import entities
from fetch_composer.entities import shapes
from fetch_composer.tasks import scene
from fetch_composer.tasks.options import TaskOptions

WORKSPACE = scene.Workspace(
    robot_position=(0.405, 0.48, 0.0),
    gripper_position=(1.3419, 0.7491, 0.555),
    table_position=(1.3, 0.75, 0.2),
    table_half_size=(0.25, 0.35, 0.2),
)

BLOCK_HALF_SIZE = shapes.DEFAULT_SIZES['box']  # m
_BLOCK_MASS = 2.0  # kg
_COLORS = ((0.1, 0.5, 0.32, 1.0), (0.85, 0.55, 0.1, 1.0))

# Of tasks that take two pushes or grasps, one after the other.
LONG_EPISODES = TaskOptions(max_episode_steps=100)


def block(options: TaskOptions, **looks) -> entities.Block:
    """Returns the block; `looks` are further arguments of `entities.Block`."""
    return entities.Block(
        size=BLOCK_HALF_SIZE, mass=_BLOCK_MASS, quaternion=options.object_quaternion, **looks
    )


def two_blocks(options: TaskOptions, names: Sequence[str]) -> tuple[entities.Block, ...]:
    """Returns a green and an orange block, of these names."""
    return tuple(
        block(options, rgba=rgba, name=name) for name, rgba in zip(names, _COLORS, strict=True)
    )
