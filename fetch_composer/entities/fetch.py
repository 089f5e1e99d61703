"""The Fetch mobile manipulator: its seven-joint arm and its two-fingered gripper."""

import os
from collections.abc import Iterable

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer import define
from dm_control.composer.observation import observable
from dm_control.entities.manipulators import base

from fetch_composer.entities import fusing, hulls, looks, servos

_DIRECTORY = os.path.dirname(__file__)
_ARM_XML = os.path.join(_DIRECTORY, 'fetch_arm.xml')
_GRIPPER_XML = os.path.join(_DIRECTORY, 'fetch_gripper.xml')

ARM_JOINTS = (
    'shoulder_pan_joint',
    'shoulder_lift_joint',
    'upperarm_roll_joint',
    'elbow_flex_joint',
    'forearm_roll_joint',
    'wrist_flex_joint',
    'wrist_roll_joint',
)

# Without geoms: they weigh on a base that can move, and do nothing to one that cannot.
_WEIGHTS = ('estop_link', 'laser_link')

# Gymnasium-Robotics holds its mobile base and torso with damping alone (N s/m).
_BASE_DAMPING = 1e11
_TORSO_DAMPING = 1e7
_BASE_ARMATURE = 1e-4  # kg
_TORSO_ARMATURE = 1.0  # kg
# What a base that can move stands on. The floor's push on it moves the gripper, so that its height
# is the mean of the four lowest points of Gymnasium-Robotics' base.
_FOOT_HALF_SIZE = (0.188, 0.12335, 0.001)  # m
_FOOT_POSITION = (-0.022, 0.00055, _FOOT_HALF_SIZE[2] + 8.21020468e-07)  # m, in the base's frame.
_TORSO_RANGE = (0.0386, 0.3861)  # m

_HEAD_PAN_RANGE = (-1.57, 1.57)  # rad
_HEAD_TILT_RANGE = (-0.76, 1.45)  # rad
_HEAD_TILT_UPRIGHT = 0.06  # rad, at which its link is level.
_HEAD_TILT_DAMPING = 1000.0  # N m s/rad

_FINGER_GAIN = 30_000.0  # N/m, of the position servo of each finger.
_FINGER_CONTROL_RANGE = (0.0, 0.2)  # m


def _compensate_gravity(mjcf_model: mjcf.RootElement, from_body: str) -> None:
    """Makes MuJoCo carry the weight of `from_body` and of everything below it."""
    root = mjcf_model.find('body', from_body)
    for body in (root, *root.find_all('body')):
        body.gravcomp = 1


def _collide_with_hulls(mjcf_model: mjcf.RootElement, names: Iterable[str], kind: str) -> None:
    """Replaces the primitives that links collide with by their convex hulls.

    Args:
        mjcf_model: The model.
        names: The links.
        kind: The default class of the hulls, which decides what they meet.
    """
    for name in names:
        body = mjcf_model.find('body', name)
        for geom in body.find_all('geom', immediate_children_only=True):
            if geom.dclass is not None and geom.dclass.dclass in ('collision', 'trunk'):
                geom.remove()
        body.add(
            'geom',
            name=name.replace('_link', '_hull'),
            dclass=mjcf_model.find('default', kind),
            type='mesh',
            mesh=mjcf_model.asset.add('mesh', name=name, vertex=hulls.HULLS[name].ravel()),
        )


class FetchArm(base.RobotArm):
    """The Fetch up to its wrist: base, torso, head and a seven-joint arm.

    The origin of the entity's frame is the origin of the world in which Fetch's base sits at
    (0.2869, 0.2641, 0) m, as in the models of Gymnasium-Robotics.
    """

    def _build(
        self,
        name: str = 'fetch',
        damped_base: bool = False,
        moving_head: bool = False,
        gravity_compensation: bool = True,
        exact_hulls: bool = False,
        actuated: bool = False,
    ) -> None:
        """Builds the arm.

        Args:
            name: Name of the entity.
            damped_base: If false, base and torso are rigidly fixed. If true they slide on
                joints of immense damping and the base stands on the floor on a foot, as
                Gymnasium-Robotics holds them.
            moving_head: If false, the head is rigidly fixed and looks down at the table. If true
                it pans and tilts on damped joints, starts level, and the arm can touch it.
            gravity_compensation: Whether the arm carries its own weight.
            exact_hulls: Whether links collide with hulls of the shapes that they have in
                Gymnasium-Robotics, or with a few primitives, which cost less.
            actuated: Whether position servos move the joints.
        """
        self._mjcf_root = mjcf.from_path(_ARM_XML)
        self._mjcf_root.model = name
        if exact_hulls:
            _collide_with_hulls(self._mjcf_root, hulls.TRUNK, 'trunk')
            _collide_with_hulls(self._mjcf_root, hulls.ARM, 'collision')
            if moving_head:
                _collide_with_hulls(self._mjcf_root, hulls.HEAD, 'head')
                _collide_with_hulls(self._mjcf_root, hulls.UPPER_ARM, 'upper_arm')
        self._base_joints: tuple[mjcf.Element, ...] = ()
        if damped_base:
            self._base_joints = self._add_base_joints()
            looks.dress(self._mjcf_root)
        else:
            fusing.fuse(self._mjcf_root.find('body', 'torso_fixed_link'))
            for weight in _WEIGHTS:
                self._mjcf_root.find('body', weight).remove()
            looks.dress(self._mjcf_root, {'torso_lift_link': 'torso'})
        self._head_joints: tuple[mjcf.Element, ...] = ()
        if moving_head:
            self._head_joints = self._add_head_joints()
        if gravity_compensation:
            _compensate_gravity(self._mjcf_root, 'shoulder_pan_link')
        self._joints = tuple(self._mjcf_root.find('joint', joint) for joint in ARM_JOINTS)
        self._actuators = servos.add(self._mjcf_root, self._joints) if actuated else ()

    def _build_observables(self):
        return FetchArmObservables(self)

    def _add_base_joints(self) -> tuple[mjcf.Element, ...]:
        base_link = self._mjcf_root.find('body', 'base_link')
        base_link.add(
            'geom',
            name='foot',
            dclass=self._mjcf_root.find('default', 'collision'),
            type='box',
            size=_FOOT_HALF_SIZE,
            pos=_FOOT_POSITION,
        )
        sliders = tuple(
            base_link.add(
                'joint',
                name=f'slide{i}',
                type='slide',
                axis=axis,
                damping=_BASE_DAMPING,
                armature=_BASE_ARMATURE,
            )
            for i, axis in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        )
        torso = self._mjcf_root.find('body', 'torso_lift_link').add(
            'joint',
            name='torso_lift_joint',
            type='slide',
            axis=(0, 0, 1),
            range=_TORSO_RANGE,
            damping=_TORSO_DAMPING,
            armature=_TORSO_ARMATURE,
        )
        return (*sliders, torso)

    def _add_head_joints(self) -> tuple[mjcf.Element, ...]:
        pan = self._mjcf_root.find('body', 'head_pan_link').add(
            'joint', name='head_pan_joint', axis=(0, 0, 1), range=_HEAD_PAN_RANGE
        )
        tilt_link = self._mjcf_root.find('body', 'head_tilt_link')
        _, down, _ = tilt_link.euler
        tilt_link.euler = None
        tilt = tilt_link.add(
            'joint',
            name='head_tilt_joint',
            axis=(0, 1, 0),
            range=_HEAD_TILT_RANGE,
            ref=_HEAD_TILT_UPRIGHT,
            damping=_HEAD_TILT_DAMPING,
        )
        # A level head's camera still looks down at the table.
        camera = self._mjcf_root.find('camera', 'head_camera')
        camera.xyaxes = (0, -1, 0, np.sin(down), 0, np.cos(down))
        return pan, tilt

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def joints(self) -> tuple[mjcf.Element, ...]:
        """The seven joints of the arm, from shoulder to wrist."""
        return self._joints

    @property
    def base_joints(self) -> tuple[mjcf.Element, ...]:
        """The base's three sliders and the torso's lift; empty if the base is fixed."""
        return self._base_joints

    @property
    def head_joints(self) -> tuple[mjcf.Element, ...]:
        """The head's pan and tilt; empty if the head is fixed."""
        return self._head_joints

    @property
    def actuators(self) -> tuple[mjcf.Element, ...]:
        """Servos of the seven joints; empty unless actuated, when a mocap body moves the arm."""
        return self._actuators

    @property
    def wrist_site(self) -> mjcf.Element:
        """Where a hand is attached; coincides with the frame of the gripper link."""
        return self._mjcf_root.find('site', 'wrist_site')


class FetchArmObservables(base.JointsObservables):
    """Joint positions (rad), joint velocities (rad/s) and the head camera."""

    @define.observable
    def head_camera(self):
        return observable.MJCFCamera(self._entity.mjcf_model.find('camera', 'head_camera'))


class FetchGripper(base.RobotHand):
    """The Fetch's parallel gripper with two fingers that slide 0.05 m each."""

    def _build(
        self,
        name: str = 'gripper',
        finger_joints: bool = False,
        actuated: bool = False,
        gravity_compensation: bool = True,
        exact_hulls: bool = False,
    ) -> None:
        """Builds the gripper.

        Args:
            name: Name of the entity.
            finger_joints: If false the gripper is locked: closed and rigid.
            actuated: Whether position servos drive the fingers; needs `finger_joints`.
            gravity_compensation: Whether the gripper carries its own weight.
            exact_hulls: As for the arm, of the palm.

        Raises:
            ValueError: if `actuated` without `finger_joints`.
        """
        if actuated and not finger_joints:
            raise ValueError('`actuated` needs `finger_joints`: a locked gripper has no joints.')
        self._mjcf_root = mjcf.from_path(_GRIPPER_XML)
        self._mjcf_root.model = name
        if exact_hulls:
            _collide_with_hulls(self._mjcf_root, hulls.PALM, 'collision')
        self._joints: tuple[mjcf.Element, ...] = ()
        self._actuators: tuple[mjcf.Element, ...] = ()
        if finger_joints:
            self._joints = tuple(
                self._mjcf_root.find('body', f'{side}_gripper_finger_link').add(
                    'joint', name=f'{side}_gripper_finger_joint', dclass='finger_joint', axis=axis
                )
                for side, axis in (('r', (0, 1, 0)), ('l', (0, -1, 0)))
            )
            looks.dress(self._mjcf_root)
        else:
            for side in 'rl':
                fusing.fuse(self._mjcf_root.find('body', f'{side}_gripper_finger_link'))
            looks.dress(self._mjcf_root, {'gripper_link': 'closed_gripper'})
        if actuated:
            self._actuators = tuple(
                self._mjcf_root.actuator.add(
                    'position',
                    name=joint.name,
                    joint=joint,
                    kp=_FINGER_GAIN,
                    ctrlrange=_FINGER_CONTROL_RANGE,
                )
                for joint in self._joints
            )
        if gravity_compensation:
            _compensate_gravity(self._mjcf_root, 'gripper_link')

    def _build_observables(self):
        return FetchGripperObservables(self)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        return self._mjcf_root

    @property
    def joints(self) -> tuple[mjcf.Element, ...]:
        """The right and the left finger's joint; empty if the gripper is locked."""
        return self._joints

    @property
    def actuators(self) -> tuple[mjcf.Element, ...]:
        """Servos of the right and the left finger; empty unless actuated."""
        return self._actuators

    @property
    def tool_center_point(self) -> mjcf.Element:
        """The observed site `grip`, 0.02 m ahead of the gripper link's frame."""
        return self._mjcf_root.find('site', 'grip')

    @property
    def gripper_link(self) -> mjcf.Element:
        """The body that is welded to the mocap body."""
        return self._mjcf_root.find('body', 'gripper_link')

    def set_grasp(self, physics, close_factors) -> None:
        """Places the fingers: 0 is open (0.05 m each), 1 is closed.

        Raises:
            ValueError: if the gripper is locked.
        """
        if not self._joints:
            raise ValueError('The gripper is locked: its fingers cannot be placed.')
        joints = physics.bind(self._joints)
        opened = joints.range[:, 1]
        joints.qpos = opened * (1 - close_factors)


class FetchGripperObservables(composer.Observables):
    """Finger positions (m) and velocities (m/s), the tool center point (m), the hand's camera."""

    @define.observable
    def finger_positions(self):
        return self._of_fingers('qpos')

    @define.observable
    def finger_velocities(self):
        return self._of_fingers('qvel')

    def _of_fingers(self, attribute: str):
        if self._entity.joints:
            return observable.MJCFFeature(attribute, self._entity.joints)
        return observable.Generic(lambda _: np.zeros(2))  # They are rigid, and closed.

    @define.observable
    def tool_center_point(self):
        return observable.MJCFFeature('xpos', self._entity.tool_center_point)

    @define.observable
    def gripper_camera(self):
        return observable.MJCFCamera(self._entity.mjcf_model.find('camera', 'gripper_camera'))
