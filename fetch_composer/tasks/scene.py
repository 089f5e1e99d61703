"""The scene of a goal task: a Fetch at a table, the handle that moves it, objects and targets."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from dm_control import mjcf
from dm_control.composer import variation

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

    def check_object_position(self, position: Sequence[float], count: int) -> np.ndarray:
        """Returns x and y of each of `count` objects, (2 count,), as an array.

        Raises:
            ValueError: if they are not two finite numbers for each, on the table.
        """
        centre, half_size = np.array(self.table_position), np.array(self.table_half_size)
        lower, upper = centre - half_size, centre + half_size
        return checks.place(
            'object_position', position, np.tile(lower[:2], count), np.tile(upper[:2], count)
        )

    def check_goal(self, goal: Sequence[float], count: int) -> np.ndarray:
        """Returns x, y and z of each of `count` goals, (3 count,), as an array.

        Raises:
            ValueError: if they are not three finite numbers for each, on or above the table.
        """
        centre, half_size = np.array(self.table_position), np.array(self.table_half_size)
        lower, upper = centre - half_size, centre + half_size
        lower[2] = upper[2] - _GOAL_BELOW_TABLE
        upper[2] = upper[2] + _GOAL_ABOVE_TABLE
        return checks.place('goal', goal, np.tile(lower, count), np.tile(upper, count))


@dataclasses.dataclass(frozen=True)
class Prop:
    """A free body that has no goal.

    Attributes:
        block: The body.
        joint: Its joint.
        position: (3,) where its centre starts in m; of x and y, nothing if they are drawn.
        sampler: Draws x and y in m for each episode; None if they are the same in all.
    """

    block: entities.Block
    joint: mjcf.Element
    position: np.ndarray
    sampler: variation.Variation | None


class Scene:
    """The entities of a goal task, attached to one another as a convention asks.

    Attributes:
        workspace: Where things are.
        arena: The room, to which all else is attached.
        arm: The robot's arm.
        gripper: Its gripper.
        table: The table.
        targets: A mark for each goal: that of each object or, without any, of the gripper.
        objects: What is moved to the goals.
        props: Further free bodies.
        obstacles: What stands fixed.
    """

    def __init__(
        self,
        workspace: Workspace,
        convention: conventions.Convention,
        objects: Sequence[entities.Block],
        obstacles: Sequence[entities.Obstacle],
        locked_gripper: bool,
        mode: action_modes.ActionMode = action_modes.DISPLACEMENT,
    ) -> None:
        """Assembles the scene.

        Args:
            workspace: Where things are.
            convention: Decides on the base, the head, gravity compensation and the locked gripper.
            objects: What is moved to the goals; each has another name.
            obstacles: What stands fixed, and where no object may start.
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

        if isinstance(objects, entities.Block):
            raise ValueError('objects must be a sequence of blocks; put a single one into a tuple.')
        self.objects = tuple(objects)
        self.targets = self._made_targets()
        self.target_frames = [self.arena.attach(each) for each in self.targets]

        self.mocap = entities.Mocap()
        self.mocap_frame = self.mocap.attach_to(self.arena)
        if not mode.joints:
            self.mocap.weld_to(self.gripper.gripper_link)

        self.object_joints = [each.attach_to(self.arena) for each in self.objects]

        self.props: list[Prop] = []
        self.obstacles = tuple(checks.sequence('obstacles', obstacles))
        for obstacle in self.obstacles:
            self.arena.attach(obstacle).pos = obstacle.position

    @property
    def num_goals(self) -> int:
        """How many places a goal has: one for each object, or the gripper's."""
        return max(1, len(self.objects))

    def _made_targets(self) -> tuple[entities.Target, ...]:
        """Returns a target for each goal; of several, each has the colour of its object."""
        if self.num_goals == 1:
            return (entities.Target(),)
        return tuple(
            entities.Target(rgba=each.rgba, name=f'target_of_{each.mjcf_model.model}')
            for each in self.objects
        )

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

    def add_prop(
        self, prop: entities.Block, position: Sequence[float] | variation.Variation
    ) -> None:
        """Adds a further free body, which has no goal and which no policy observes.

        Args:
            prop: The body.
            position: (3,) position of its centre in m, at which every episode starts it; or what
                draws x and y in m, (2,), for each, and is given those of the objects as
                `initial_value`. Then it rests on the table, clear of all else.

        Raises:
            ValueError: if the position is neither.
        """
        sampler = position if isinstance(position, variation.Variation) else None
        if not sampler:
            checks.finite('The position of a prop', position, (3,))
        centre = np.zeros(3) if sampler else np.array(position, dtype=np.float64)
        if sampler:
            centre[2] = self.workspace.table_top + prop.half_height
        self.props.append(Prop(prop, prop.attach_to(self.arena), centre, sampler))

    @property
    def drawn_props(self) -> list[Prop]:
        """The props whose places are drawn."""
        return [each for each in self.props if each.sampler is not None]
