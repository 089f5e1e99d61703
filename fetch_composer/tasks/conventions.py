"""Two readings of the Fetch tasks: what their page says and what the published code does.

`documented` holds every number and formula of the specification page. `gymnasium_robotics`
reproduces the v4 environments of Gymnasium-Robotics 1.4.2, which differ from their page. A
convention is a set of named choices; tasks ask for a choice and never for the convention's name.
"""

import dataclasses
import functools
import importlib.resources
import json

import numpy as np

# Points the gripper's x axis, along which its fingers extend, straight down.
POINTING_DOWN = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
_IDENTITY = (1.0, 0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Convention:
    """Where the two readings part.

    Attributes:
        name: As passed to `load`.
        damped_base: Whether base and torso slide on joints of immense damping, or are fixed.
        gravity_compensation: Whether the arm carries its own weight.
        exact_hulls: Whether links collide with hulls of the peer's shapes, or with primitives.
        islands: Whether MuJoCo solves independent sets of constraints apart, which pays in larger
            scenes and is its default. It changes positions by less than 1e-9 m.
        rigid_lock: Whether a locked gripper is rigid. If not, its fingers are free to slide
            within a control step and are put back at its end.
        settled_start: Whether an episode starts from the peer's settled state, or at rest with
            the gripper at the documented pose.
        block_minus_gripper: Whether obs[6:9] is block - gripper, or gripper - block.
        additive_rotation: Whether the mocap quaternion is the gripper's plus (1, 0, 1, 0),
            which only approximates a fixed rotation, or fixed.
        block_quaternion: The block's orientation at the start, (w, x, y, z).
        refresh_unlocked: Whether kinematics are brought up to date before observing a gripper
            that is not locked. The peer observes positions one substep late.
    """

    name: str
    damped_base: bool
    gravity_compensation: bool
    exact_hulls: bool
    islands: bool
    rigid_lock: bool
    settled_start: bool
    block_minus_gripper: bool
    additive_rotation: bool
    block_quaternion: tuple[float, float, float, float]
    refresh_unlocked: bool


DOCUMENTED = Convention(
    name='documented',
    damped_base=False,
    gravity_compensation=True,
    exact_hulls=False,
    islands=False,
    rigid_lock=True,
    settled_start=False,
    block_minus_gripper=False,
    additive_rotation=False,
    block_quaternion=POINTING_DOWN,
    refresh_unlocked=True,
)

GYMNASIUM_ROBOTICS = Convention(
    name='gymnasium_robotics',
    damped_base=True,
    gravity_compensation=False,
    exact_hulls=True,
    islands=True,
    rigid_lock=False,
    settled_start=True,
    block_minus_gripper=True,
    additive_rotation=True,
    block_quaternion=_IDENTITY,
    refresh_unlocked=False,
)

CONVENTIONS = {convention.name: convention for convention in (DOCUMENTED, GYMNASIUM_ROBOTICS)}


def get(name: str) -> Convention:
    """Returns the convention of that name.

    Raises:
        ValueError: if there is none; the message lists the valid names.
    """
    if name not in CONVENTIONS:
        raise ValueError(f'Unknown convention {name!r}; valid are {", ".join(CONVENTIONS)}.')
    return CONVENTIONS[name]


@dataclasses.dataclass(frozen=True)
class SettledState:
    """A task's state once the peer has built its environment, before anything is sampled.

    Attributes:
        grip_position: (3,) position of the grip site in m, around which the peer samples.
        qpos: {joint: position} of base, torso, arm and fingers, in m or rad.
        qvel: {joint: velocity} of the same, in m/s or rad/s.
        object_height: Height of the object's centre in m, or None without an object.
        object_qpos: (7,) pose of the object: position in m and quaternion.
        object_qvel: (6,) velocity of the object in m/s and rad/s.
    """

    grip_position: np.ndarray
    qpos: dict[str, float]
    qvel: dict[str, float]
    object_height: float | None
    object_qpos: np.ndarray | None
    object_qvel: np.ndarray | None


def _figures() -> dict:
    folder = importlib.resources.files('fetch_composer.tasks')
    return json.loads(folder.joinpath('settled_states.json').read_text())


_FIGURES = _figures()
SETTLED_TASKS = tuple(sorted(set(_FIGURES) - {'source', 'joints'}))


@functools.cache
def settled_state(task_name: str) -> SettledState:
    """Returns the settled state of a task; see settled_states.json for its source.

    Raises:
        ValueError: if the peer has no such task; the message lists those that it has.
    """
    if task_name not in SETTLED_TASKS:
        raise ValueError(
            f'The task {task_name!r} has no gymnasium_robotics convention; only '
            f'{", ".join(SETTLED_TASKS)} have.'
        )
    state = _FIGURES[task_name]

    def array_or_none(key):
        return np.array(state[key]) if key in state else None

    return SettledState(
        grip_position=np.array(state['grip_position']),
        qpos=dict(zip(_FIGURES['joints'], state['qpos'], strict=True)),
        qvel=dict(zip(_FIGURES['joints'], state['qvel'], strict=True)),
        object_height=state.get('object_height'),
        object_qpos=array_or_none('object_qpos'),
        object_qvel=array_or_none('object_qvel'),
    )
