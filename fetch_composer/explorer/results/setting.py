"""What files and report of a run say of its task."""

import dataclasses

from fetch_composer.tasks import Workspace
from fetch_composer.tasks.state import Identity


@dataclasses.dataclass(frozen=True)
class Setting:
    """What files and report of a run say of its task.

    Attributes:
        task_name: Name of the task.
        convention: Name of the convention.
        workspace: Where the table is.
        has_object: Whether the achieved goal is the place of objects, or of the gripper.
        control_timestep: Seconds from one control step to the next.
        max_steps: Control steps of an episode that does not end before.
        identity: What a state of the task must share with it.
        object_shape: What its objects are; None for the task's own.
    """

    task_name: str
    convention: str
    workspace: Workspace
    has_object: bool
    control_timestep: float
    max_steps: int
    identity: Identity
    object_shape: str | None = None

    @classmethod
    def of(cls, env) -> 'Setting':
        """Returns the setting of a single environment, as `fetch_composer.load` returns it."""
        task = env.task
        return cls(
            task.name,
            task.convention.name,
            task.workspace,
            bool(task.scene.objects),
            env.control_timestep(),
            task.options.max_episode_steps,
            task.identity,
            task.options.object_shape,
        )
