"""Two readings of the Fetch tasks: what their page says and what the published code does.

`documented` holds every number and formula of the specification page. `gymnasium_robotics`
reproduces the v4 environments of Gymnasium-Robotics 1.4.2, which differ from their page. A
convention is a set of named choices; tasks ask for a choice and never for the convention's name.
"""

import dataclasses

import numpy as np

from fetch_composer.tasks import action_modes

# Points the gripper's x axis, along which its fingers extend, straight down.
POINTING_DOWN = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
_IDENTITY = (1.0, 0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Convention:
    """Where the two readings part.

    Attributes:
        name: As passed to `load`.
        damped_base: Whether base and torso slide on joints of immense damping, or are fixed.
        moving_head: Whether the head pans and tilts on damped joints and can be touched by the
            arm, or is fixed.
        gravity_compensation: Whether the arm carries its own weight.
        exact_hulls: Whether links collide with hulls of Gymnasium-Robotics' shapes, or
            with primitives.
        massless_frames: Whether the frames in which entities are attached weigh nothing, which
            is right, or 1e-5 kg, which is Composer's default.
        islands: Whether MuJoCo solves independent sets of constraints apart, which pays in larger
            scenes and is its default. Without it pucks that glide end elsewhere by up to 7 mm, and
            blocks by less than 1e-9 m.
        rigid_lock: Whether a locked gripper is rigid. If not, its fingers are free to slide
            within a control step and are put back at its end.
        settled_start: Whether an episode starts from the state in which Gymnasium-Robotics has
            settled, or at rest with the gripper at the documented pose.
        object_minus_gripper: Whether obs[6:9] is object - gripper, or gripper - object.
        additive_rotation: Whether the mocap quaternion is the gripper's plus (1, 0, 1, 0),
            which only approximates a fixed rotation, or fixed.
        object_quaternion: The object's orientation at the start, (w, x, y, z).
        refresh_unlocked: Whether kinematics are brought up to date before observing a gripper
            that is not locked. Gymnasium-Robotics observes positions one substep late.
        action_modes: Names of the ways to act that there are.
    """

    name: str
    damped_base: bool
    moving_head: bool
    gravity_compensation: bool
    exact_hulls: bool
    massless_frames: bool
    islands: bool
    rigid_lock: bool
    settled_start: bool
    object_minus_gripper: bool
    additive_rotation: bool
    object_quaternion: tuple[float, float, float, float]
    refresh_unlocked: bool
    action_modes: tuple[str, ...]


DOCUMENTED = Convention(
    name='documented',
    damped_base=False,
    moving_head=False,
    gravity_compensation=True,
    exact_hulls=False,
    massless_frames=False,
    islands=False,
    rigid_lock=True,
    settled_start=False,
    object_minus_gripper=False,
    additive_rotation=False,
    object_quaternion=POINTING_DOWN,
    refresh_unlocked=True,
    action_modes=tuple(action_modes.MODES),
)

GYMNASIUM_ROBOTICS = Convention(
    name='gymnasium_robotics',
    damped_base=True,
    moving_head=True,
    gravity_compensation=False,
    exact_hulls=True,
    massless_frames=True,
    islands=True,
    rigid_lock=False,
    settled_start=True,
    object_minus_gripper=True,
    additive_rotation=True,
    object_quaternion=_IDENTITY,
    refresh_unlocked=False,
    action_modes=(action_modes.DISPLACEMENT.name,),
)

CONVENTIONS = {convention.name: convention for convention in (DOCUMENTED, GYMNASIUM_ROBOTICS)}
