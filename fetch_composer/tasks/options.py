"""What may be chosen about a task, whichever task it is."""

import dataclasses
from collections.abc import Mapping, Sequence

from fetch_composer.entities import shapes
from fetch_composer.tasks import action_modes, checks, conventions, rewards
from fetch_composer.tasks import pixels as pixels_lib

MAX_EPISODE_STEPS = 50


@dataclasses.dataclass(frozen=True)
class TaskOptions:
    """Options of a task, checked as they are given.

    Attributes:
        reward_type: 'sparse' or 'dense'.
        max_episode_steps: Control steps after which an episode is truncated; None for episodes
            that never end.
        terminate_on_success: Whether an episode ends as soon as its goal is achieved, with
            discount 0.
        convention: 'documented' or 'gymnasium_robotics'.
        action_mode: What an action moves: 'displacement' of the gripper, 'displacement+yaw',
            'displacement+rotation', or the 'joints' of the arm. The convention
            'gymnasium_robotics' has the first alone.
        object_shape: What each object is: 'box', 'cylinder', 'capsule', 'ellipsoid', or 'mesh' of
            a file; None for the task's own. For the convention 'documented' alone.
        object_size: Half sizes of that in m, as MuJoCo has them, or one number for all; of a mesh,
            those of its bounding box, or the largest; None for those of about a block.
        object_mesh: Path of the .obj or .stl file of a mesh.
        object_position: (2,) x and y in m at which the object starts in every episode; with several
            objects, two numbers for each.
        goal: (3,) desired goal in m of every episode; with several objects, three for each.
        observation_mode: 'features' for the vector `observation`, 'pixels' for what cameras see
            in its place, or 'features+pixels' for both.
        pixels: {option: value} of `PixelOptions`.
        variations: {name: variation} of what differs between episodes; see
            `variations.DESCRIPTIONS`.

    Raises:
        ValueError: if a value is not valid; the message says what would be. Places are checked
            by the task, which knows its table.
    """

    reward_type: str = 'sparse'
    max_episode_steps: int | None = MAX_EPISODE_STEPS
    terminate_on_success: bool = False
    convention: str = 'documented'
    action_mode: str = action_modes.DISPLACEMENT.name
    object_shape: str | None = None
    object_size: Sequence[float] | None = None
    object_mesh: str | None = None
    object_position: Sequence[float] | None = None
    goal: Sequence[float] | None = None
    observation_mode: str = 'features'
    pixels: Mapping | pixels_lib.PixelOptions | None = None
    variations: Mapping | None = None

    def __post_init__(self) -> None:
        checks.one_of('reward_type', self.reward_type, rewards.REWARD_TYPES)
        checks.one_of('convention', self.convention, conventions.CONVENTIONS)
        checks.one_of('observation_mode', self.observation_mode, pixels_lib.OBSERVATION_MODES)
        checks.one_of('action_mode', self.action_mode, action_modes.MODES)
        modes = conventions.CONVENTIONS[self.convention].action_modes
        if self.action_mode not in modes:
            raise ValueError(
                f'The convention {self.convention!r} has no action_mode {self.action_mode!r}; '
                f'valid are {", ".join(modes)}.'
            )
        self._check_object()
        if self.max_episode_steps is not None:
            steps = checks.integer(
                'max_episode_steps', self.max_episode_steps, 1, 'None for episodes that never end'
            )
            object.__setattr__(self, 'max_episode_steps', steps)
        terminates = checks.boolean('terminate_on_success', self.terminate_on_success)
        object.__setattr__(self, 'terminate_on_success', terminates)
        object.__setattr__(self, 'pixels', pixels_lib.options(self.pixels))

    def _check_object(self) -> None:
        if self.object_shape is not None:
            checks.one_of('object_shape', self.object_shape, shapes.NAMES)
            if conventions.CONVENTIONS[self.convention].settled_start:
                raise ValueError(
                    f'The convention {self.convention!r} has no object_shape but that of the '
                    "task's own object, with which its start has settled; use the documented one."
                )
        object.__setattr__(self, 'object_size', self._checked_size())
        needs_mesh = self.object_shape == shapes.MESH
        if needs_mesh and self.object_mesh is None:
            raise ValueError("The object_shape 'mesh' needs an object_mesh: an .obj or .stl file.")
        if self.object_mesh is not None and not (needs_mesh or self.varies_shape):
            raise ValueError(
                "object_mesh is of the object_shape 'mesh', or of the variation 'object_shape'; "
                'give one of them too.'
            )

    def _checked_size(self) -> tuple[float, ...] | None:
        if self.object_size is None:
            return None
        if self.object_shape is None:
            raise ValueError(
                f'object_size is of an object_shape; give one of {", ".join(shapes.NAMES)} too.'
            )
        return checks.sizes(
            f'object_size of a {self.object_shape}',
            self.object_size,
            shapes.num_sizes(self.object_shape),
            shapes.SMALLEST,
            shapes.LARGEST,
        )

    @property
    def varies_shape(self) -> bool:
        """Whether the objects' shape is drawn for each episode."""
        return isinstance(self.variations, Mapping) and 'object_shape' in self.variations

    @property
    def object_quaternion(self) -> tuple[float, float, float, float]:
        """(w, x, y, z) at which the convention starts an object."""
        return conventions.CONVENTIONS[self.convention].object_quaternion

    @property
    def mode(self) -> action_modes.ActionMode:
        """What the numbers of an action ask for."""
        return action_modes.MODES[self.action_mode]


NAMES = tuple(field.name for field in dataclasses.fields(TaskOptions))
