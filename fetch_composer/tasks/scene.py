"""The scene of a goal task: a Fetch at a table, the handle that moves it, and a target."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from dm_control import mjcf

from fetch_composer import entities
from fetch_composer.tasks import action_modes, checks, conventions

# A goal may lie this far below and above the table's surface, in m.
_GOAL_BELOW_TABLE = 0.02
_GOAL_ABOVE_TABLE = 0.6


@dataclasses.dataclass(frozen=True)
class Workspace:
    """Where robot, gripper and table are, in m.

    Attributes:
        robot_position: Origin of the robot's frame.
        gripper_position: Documented start of the gripper link's frame.
        table_position: Centre of the table.
        table_half_size: Half of the table's length, width and height.
        table_friction: Sliding, torsional and rolling coefficients. MuJoCo gives a contact the
            larger of what its two geoms have, so that an object that is to slide needs a low
            friction of its own as well.
    """

    robot_position: tuple[float, float, float]
    gripper_position: tuple[float, float, float]
    table_position: tuple[float, float, float]
    table_half_size: tuple[float, float, float]
    table_friction: tuple[float, float, float] = (1.0, 0.005, 0.0001)

    @property
    def table_top(self) -> float:
        """Height of the table's surface in m."""
        return self.table_position[2] + self.table_half_size[2]

    def check_object_position(self, position: Sequence[float]) -> np.ndarray:
        """Returns (2,) x and y as an array.

        Raises:
            ValueError: if they are not two finite numbers on the table.
        """
        centre, half_size = np.array(self.table_position), np.array(self.table_half_size)
        lower, upper = centre - half_size, centre + half_size
        return checks.place('object_position', position, lower[:2], upper[:2])

    def check_goal(self, goal: Sequence[float]) -> np.ndarray:
        """Returns (3,) x, y and z as an array.

        Raises:
            ValueError: if they are not three finite numbers on or above the table.
        """
        centre, half_size = np.array(self.table_position), np.array(self.table_half_size)
        lower, upper = centre - half_size, centre + half_size
        lower[2] = upper[2] - _GOAL_BELOW_TABLE
        upper[2] = upper[2] + _GOAL_ABOVE_TABLE
        return checks.place('goal', goal, lower, upper)


class Scene:
    """The entities of a goal task, attached to one another as a convention asks."""

    def __init__(
        self,
        workspace: Workspace,
        convention: conventions.Convention,
        block: entities.Block | None,
        locked_gripper: bool,
        mode: action_modes.ActionMode = action_modes.DISPLACEMENT,
    ) -> None:
        """Assembles the scene.

        Args:
            workspace: Where things are.
            convention: Decides on the base, the head, gravity compensation and the locked gripper.
            block: The object, or None.
            locked_gripper: Whether the gripper stays closed.
            mode: Decides on what moves the arm: a mocap body, or servos of its joints.
        """
        self.workspace = workspace
        self.arena = entities.Arena()
        if not convention.islands:
            self.arena.mjcf_model.option.flag.island = 'disable'
        if convention.massless_frames:
            compiler = self.arena.mjcf_model.compiler
            compiler.boundmass = compiler.boundinertia = 0
        self.arm = entities.FetchArm(
            damped_base=convention.damped_base,
            moving_head=convention.moving_head,
            gravity_compensation=convention.gravity_compensation,
            exact_hulls=convention.exact_hulls,
            actuated=bool(mode.joints),
        )
        self.gripper = entities.FetchGripper(
            finger_joints=not (locked_gripper and convention.rigid_lock),
            actuated=not locked_gripper,
            gravity_compensation=convention.gravity_compensation,
            exact_hulls=convention.exact_hulls,
        )
        self.arm.attach(self.gripper)
        self.arena.attach(self.arm).pos = workspace.robot_position

        self.table = entities.Table(workspace.table_half_size, workspace.table_friction)
        self.arena.attach(self.table).pos = workspace.table_position

        self.target = entities.Target()
        self.target_frame = self.arena.attach(self.target)

        self.mocap = entities.Mocap()
        self.mocap_frame = self.mocap.attach_to(self.arena)
        if not mode.joints:
            self.mocap.weld_to(self.gripper.gripper_link)

        self.block = block
        self.block_joint = None
        if block is not None:
            self.block_joint = block.attach_to(self.arena)

        self.props: list[tuple[entities.Block, mjcf.Element, Sequence[float]]] = []

    def remove_looks(self, cameras: bool) -> None:
        """Removes what can be seen and not touched.

        Args:
            cameras: Whether to remove cameras and the light as well.
        """
        for robot in (self.arm, self.gripper):
            for geom in robot.mjcf_model.find_all('geom', exclude_attachments=True):
                if geom.dclass is not None and geom.dclass.dclass == 'visual':
                    for asset in (geom.mesh, geom.material):
                        if asset is not None:
                            asset.remove()
                    geom.remove()
        if cameras:
            model = self.arena.mjcf_model
            for each in (*model.find_all('camera'), *model.find_all('light')):
                each.remove()

    def add_prop(self, prop: entities.Block, position: Sequence[float]) -> None:
        """Adds a further free body, which every episode starts at a position.

        Args:
            prop: The body.
            position: (3,) position of its centre in m.
        """
        self.props.append((prop, prop.attach_to(self.arena), position))
