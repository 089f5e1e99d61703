"""Position servos for the joints of the arm, as strong as those of the real robot."""

import dataclasses
from collections.abc import Iterable

from dm_control import mjcf

# With this frequency and critical damping, 0.05 rad take 0.4 s to within 2 %, and none is
# overshot. Faster servos swing where the arm is stretched, for they are not strong enough.
_FREQUENCY = 15.0  # rad/s


@dataclasses.dataclass(frozen=True)
class _Servo:
    """Figures of a joint.

    Attributes:
        effort: Limit of the servo's torque in N m, of fetch.urdf (fetch_ros).
        damping: Of the joint in N m s/rad, from the same file.
        inertia: In kg m^2, about what the servo moves with the gripper over the table.
    """

    effort: float
    damping: float
    inertia: float


_SERVOS = {
    'shoulder_pan_joint': _Servo(effort=33.82, damping=1.0, inertia=10.0),
    'shoulder_lift_joint': _Servo(effort=131.76, damping=1.0, inertia=8.0),
    'upperarm_roll_joint': _Servo(effort=76.94, damping=5.0, inertia=4.2),
    'elbow_flex_joint': _Servo(effort=66.18, damping=1.0, inertia=5.0),
    'forearm_roll_joint': _Servo(effort=29.35, damping=5.0, inertia=3.5),
    'wrist_flex_joint': _Servo(effort=25.7, damping=1.0, inertia=2.0),
    'wrist_roll_joint': _Servo(effort=7.36, damping=5.0, inertia=1.2),
}


def add(mjcf_model: mjcf.RootElement, joints: Iterable[mjcf.Element]) -> tuple[mjcf.Element, ...]:
    """Adds a servo for each joint of the arm, whose control is the joint's position in rad.

    Joints get the real robot's damping, and lose their springs: the figures of the model's own
    are made for an arm that is pulled by its gripper, and would hold it back.

    Args:
        mjcf_model: The model of the arm.
        joints: Its joints.

    Returns:
        The actuators, in the order of the joints.
    """
    return tuple(_add(mjcf_model, joint, _SERVOS[joint.name]) for joint in joints)


def _add(mjcf_model: mjcf.RootElement, joint: mjcf.Element, servo: _Servo) -> mjcf.Element:
    joint.damping, joint.stiffness = servo.damping, 0.0
    within = {} if joint.range is None else {'ctrlrange': joint.range}
    return mjcf_model.actuator.add(
        'position',
        name=joint.name,
        joint=joint,
        kp=servo.inertia * _FREQUENCY**2,
        kv=servo.inertia * 2 * _FREQUENCY,
        forcerange=(-servo.effort, servo.effort),
        **within,
    )
