"""What files and report of a run say of its task."""

import dataclasses

from fetch_composer.tasks import Workspace


@dataclasses.dataclass(frozen=True)
class Setting:
    """What files and report of a run say of its task.

    Attributes:
        task_name: Name of the task.
        convention: Name of the convention.
        workspace: Where the table is.
        has_object: Whether the achieved goal is the place of an object, or of the gripper.
        control_timestep: Seconds from one control step to the next.
    """

    task_name: str
    convention: str
    workspace: Workspace
    has_object: bool
    control_timestep: float

    @classmethod
    def of(cls, env) -> 'Setting':
        """Returns the setting of a single environment, as `fetch_composer.load` returns it."""
        task = env.task
        return cls(
            task.name,
            task.convention.name,
            task.workspace,
            task.scene.block is not None,
            env.control_timestep(),
        )
