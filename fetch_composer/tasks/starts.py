"""Where episodes start: what is given, what is drawn, and the state that follows."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from dm_control import composer, mjcf
from dm_control.composer import variation
from dm_control.utils import inverse_kinematics

from fetch_composer.tasks import checks, conventions
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.clearance import FINGERTIP_DEPTH, Clearance
from fetch_composer.tasks.scene import Prop, Scene
from fetch_composer.tasks.settled import SettledState
from fetch_composer.tasks.variations import Variations

# Configuration from which inverse kinematics starts, shoulder to wrist in rad: elbow up, near
# the pose in which Gymnasium-Robotics settles.
_ELBOW_UP = (0.01, -0.83, 0.0, 1.44, 0.0, 0.95, 0.0)
_TOLERANCE = 1e-12  # Of the inverse kinematics, in m and rad.
_MAX_ERROR = 1e-5  # m

_MAX_REJECTIONS = 1000


@dataclasses.dataclass(frozen=True)
class Start:
    """What differs between the starts of two episodes.

    Attributes:
        object_position: (2 n,) x and y in m at which each of n objects starts; None without one.
        goal: (3 n,) desired goal in m.
        variations: What was drawn for this episode, by name of the variation.
        prop_position: (2 k,) x and y in m at which each of k props starts whose places are drawn.
    """

    object_position: np.ndarray | None = None
    goal: np.ndarray | None = None
    variations: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)
    prop_position: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, given: Mapping[str, np.ndarray]) -> 'Start':
        """Returns a start with the places that `given` has returned."""
        places = {name: np.array(place, dtype=np.float64) for name, place in given.items()}
        return cls(places.get('object_position'), places.get('goal'))

    def given(self) -> dict[str, np.ndarray]:
        """Returns copies of the places that are not None, by name."""
        places = {'object_position': self.object_position, 'goal': self.goal}
        return {name: place.copy() for name, place in places.items() if place is not None}


@dataclasses.dataclass(frozen=True)
class StartState:
    """(nq,) qpos, (nv,) qvel, and the mocap body's position in m and quaternion."""

    qpos: np.ndarray
    qvel: np.ndarray
    mocap_position: np.ndarray
    mocap_quaternion: np.ndarray


class EpisodeStarts:
    """The starts of one task's episodes."""

    def __init__(
        self,
        scene: Scene,
        grip_start: np.ndarray,
        object_heights: Sequence[float],
        object_sampler: variation.Variation | None,
        goal_sampler: variation.Variation,
        variations: Variations,
        raised_goal: Callable[[np.ndarray, np.ndarray], np.ndarray],
        settled: SettledState | None,
    ) -> None:
        """Initializes the starts.

        Args:
            scene: The scene.
            grip_start: (3,) start of the observed grip site in m.
            object_heights: Height in m at which each object's centre rests.
            object_sampler: Draws the objects' x and y; None without any.
            goal_sampler: Draws the desired goal; as `initial_value` it is given what the
                other has drawn.
            variations: What else differs between episodes.
            raised_goal: Returns a drawn goal for objects of another shape, given by how many m each
                of them rests higher.
            settled: The state to start from; None to start at rest at the documented pose.
        """
        self._scene = scene
        self._workspace = scene.workspace
        self._grip_start = grip_start
        self._object_heights = object_heights
        self._object_sampler = object_sampler
        self._goal_sampler = goal_sampler
        self._variations = variations
        self._raised_goal = raised_goal
        self._settled = settled
        self._clearance = Clearance(scene, grip_start, variations)
        self._every_episode = Start()

    @property
    def samplers(self) -> tuple[variation.Variation | None, variation.Variation]:
        """What samples the objects' places, None without any, and the desired goal."""
        return self._object_sampler, self._goal_sampler

    def fix(self, start: Start) -> None:
        """Gives what every episode starts with, from what `check` returned."""
        self._every_episode = start

    def check(self, object_position=None, goal=None) -> Start:
        """Returns given places as a `Start`, with None for what is not given.

        Raises:
            ValueError: if a place cannot be.
        """
        if object_position is not None:
            count = len(self._scene.objects)
            if not count:
                raise ValueError('object_position was given, but this task has no object.')
            object_position = self._workspace.check_object_position(object_position, count)
            obstacle = self._clearance.in_the_way(object_position)
            if obstacle is not None:
                raise ValueError(obstacle)
        if goal is not None:
            goal = self._workspace.check_goal(goal, self._scene.num_goals)
        return Start(object_position, goal)

    def check_restored(
        self,
        variations: Mapping[str, np.ndarray],
        given: Mapping[str, np.ndarray],
        has_begun: bool,
    ) -> None:
        """Raises `ValueError` if what a state says was drawn, or given, cannot have been."""
        if variations or has_begun:
            self._variations.check_drawn(variations)
        unknown = [name for name in given if name not in ('object_position', 'goal')]
        if unknown:
            raise ValueError(
                f'The state gives {checks.shown(unknown)} for the next episode; valid are '
                f'object_position, goal.'
            )
        self.check(**given)

    def draw(
        self,
        random_state: np.random.RandomState,
        given: Start = Start(),  # noqa: B008
    ) -> Start:
        """Draws where an episode starts and what its goal is.

        Everything is drawn, given or not, so that giving one place leaves the other as it was.

        Args:
            random_state: What to draw from.
            given: Places that override the task's own and the drawn ones.

        Raises:
            ValueError: if a variation draws what cannot be, or no place is left for the object.
        """
        drawn = self._draw_places(random_state)
        variations = self._variations.draw(random_state)
        self._check_above_table(variations)
        for _ in range(_MAX_REJECTIONS):
            start = self._chosen(given, drawn, variations)
            obstacle = self._clearance.in_the_way(start.object_position, variations)
            if obstacle is None:
                return self._with_props(start, random_state)
            if start.object_position is not drawn.object_position:
                raise ValueError(obstacle)
            drawn = self._draw_places(random_state)
        raise ValueError(
            f'No place for objects of this object_size was found in {_MAX_REJECTIONS} draws, '
            f'wherever gripper_offset starts the gripper: {obstacle}'
        )

    def _draw_places(self, random_state: np.random.RandomState) -> Start:
        sampler = self._object_sampler
        places = None if sampler is None else sampler(random_state=random_state)
        goal = self._goal_sampler(initial_value=places, random_state=random_state)
        count = self._scene.num_goals
        for what, drawn, size in (('places', places, 2), ('goals', goal, 3)):
            if drawn is not None and np.shape(drawn) != (size * count,):
                raise ValueError(
                    f'The sampler of {what} must draw {size} numbers for each of {count}, shape '
                    f'({size * count},); it drew {checks.shown(drawn)}.'
                )
        return Start(places, goal)

    def _chosen(self, given: Start, drawn: Start, variations: Mapping[str, np.ndarray]) -> Start:
        """Returns the places that are given, or else the task's own, or else drawn."""
        sources = (given, self._every_episode, drawn)
        start = Start(
            next((s.object_position for s in sources if s.object_position is not None), None),
            next(s.goal for s in sources if s.goal is not None),
            variations,
        )
        if 'object_shape' in variations and start.goal is drawn.goal is not None:
            raised = np.array(self._variations.raised_by_shape(variations))
            return dataclasses.replace(start, goal=self._raised_goal(drawn.goal, raised))
        return start

    def _check_above_table(self, values: Mapping[str, np.ndarray]) -> None:
        offset = values.get('gripper_offset')
        if offset is None:
            return
        fingertips = self._grip_start[2] + offset[2] - FINGERTIP_DEPTH
        if fingertips < self._workspace.table_top:
            lowest = self._workspace.table_top - self._grip_start[2] + FINGERTIP_DEPTH
            raise ValueError(
                f"'gripper_offset' drew {offset.tolist()}, which starts the fingers in the table: "
                f'its z must be at least {lowest:.4f} m.'
            )

    def _with_props(self, start: Start, random_state) -> Start:
        """Returns a start with places for the props, clear of all else that stands on the table."""
        if not self._scene.drawn_props:
            return start
        assert start.goal is not None, 'One is drawn.'
        occupied = self._clearance.occupied(start.object_position, start.goal, start.variations)
        places: list[np.ndarray] = []
        for prop in self._scene.drawn_props:
            places.append(self._place_of(prop, start, occupied, random_state))
            occupied.append((places[-1], prop.block.solid.reach))
        return dataclasses.replace(start, prop_position=np.concatenate(places))

    def _place_of(self, prop: Prop, start: Start, occupied, random_state) -> np.ndarray:
        assert prop.sampler is not None, 'Its place is drawn.'
        for _ in range(_MAX_REJECTIONS):
            place = prop.sampler(initial_value=start.object_position, random_state=random_state)
            checks.finite('The place of a prop', place, (2,))
            place = np.array(place, dtype=np.float64)
            if self._clearance.is_clear(prop, place, occupied, start.variations):
                return place
        raise ValueError(
            f'No place for the prop {prop.block.mjcf_model.model!r} that is clear of all else was '
            f'found in {_MAX_REJECTIONS} draws; widen the range of its sampler.'
        )

    def compile(self, physics: mjcf.Physics, addresses: Addresses) -> None:
        """Finds the state that episodes have in common.

        Raises:
            EpisodeInitializationError: if inverse kinematics does not find it.
        """
        self._physics, self._addresses = physics, addresses
        if self._settled is None:
            self._common_state = self._state_at_rest()
        else:
            self._common_state = self._settled_state(self._settled)

    def state(self, start: Start) -> StartState:
        """Returns the state in which an episode with that start begins, its goal aside.

        Raises:
            EpisodeInitializationError: if the gripper cannot be brought where it was drawn.
        """
        state = self._common_state
        if 'gripper_offset' in start.variations:
            state = self._state_at_rest(start.variations['gripper_offset'])
        if start.object_position is not None:
            qpos = state.qpos.copy()
            raised = self._variations.raised(start.variations)
            places = start.object_position.reshape(-1, 2)
            for where, place, height in zip(
                self._addresses.object_qpos, places, raised, strict=True
            ):
                qpos[where][:2] = place
                qpos[where][2] += height
            state = dataclasses.replace(state, qpos=qpos)
        if start.prop_position.size:
            state = dataclasses.replace(state, qpos=self._place_props(state.qpos.copy(), start))
        return state

    def _place_props(self, qpos: np.ndarray, start: Start) -> np.ndarray:
        """Puts the props whose places are drawn in place; returns `qpos`."""
        places = start.prop_position.reshape(-1, 2)
        for where, place in zip(self._addresses.prop_qpos, places, strict=True):
            qpos[where][:2] = place
        return qpos

    def _state_at_rest(self, gripper_offset: npt.ArrayLike = (0.0, 0.0, 0.0)) -> StartState:
        """Returns the state at rest with the gripper link at a place, pointing down."""
        scene, model, addresses = self._scene, self._physics.model.ptr, self._addresses
        gripper_position = np.add(self._workspace.gripper_position, gripper_offset)
        qpos = model.qpos0.copy()
        qpos[addresses.arm_qpos] = self._solve(gripper_position)
        for where, each, height in zip(
            addresses.object_qpos, scene.objects, self._object_heights, strict=True
        ):
            qpos[where][2] = height
            qpos[where][3:] = each.quaternion
        for prop in scene.props:
            address = model.jnt_qposadr[self._physics.bind(prop.joint).element_id]
            qpos[address : address + 7] = (*prop.position, *prop.block.quaternion)
        return StartState(
            qpos=qpos,
            qvel=np.zeros(model.nv),
            mocap_position=gripper_position,
            mocap_quaternion=np.array(conventions.POINTING_DOWN),
        )

    def usual_qpos(self, start: Start) -> np.ndarray:
        """Returns (nq,) positions that episodes have in common, with the props of one in place."""
        return self._place_props(self._common_state.qpos.copy(), start)

    def _solve(self, gripper_position: np.ndarray) -> np.ndarray:
        """Returns (7,) arm joints in rad."""
        physics, arm = self._physics, self._scene.arm
        physics.bind(arm.joints).qpos = _ELBOW_UP
        result = inverse_kinematics.qpos_from_site_pose(
            physics,
            arm.wrist_site.full_identifier,
            target_pos=gripper_position,
            target_quat=conventions.POINTING_DOWN,
            joint_names=[joint.full_identifier for joint in arm.joints],
            tol=_TOLERANCE,
            inplace=True,
        )
        if result.err_norm > _MAX_ERROR:
            raise composer.EpisodeInitializationError(
                f'The gripper cannot be brought to {np.round(gripper_position, 4).tolist()} m, '
                'pointing down: inverse kinematics is left with an error of '
                f'{result.err_norm:.2g}.'
            )
        return result.qpos[self._addresses.arm_qpos]

    def _settled_state(self, settled: SettledState) -> StartState:
        """Returns the state in which Gymnasium-Robotics has settled."""
        scene, model, addresses = self._scene, self._physics.model.ptr, self._addresses
        qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
        arm = scene.arm
        joints = (*arm.base_joints, *arm.head_joints, *arm.joints, *scene.gripper.joints)
        for joint in joints:
            index = model.joint(joint.full_identifier).id
            qpos[model.jnt_qposadr[index]] = settled.qpos[joint.name]
            qvel[model.jnt_dofadr[index]] = settled.qvel[joint.name]
        if scene.objects:
            (object_qpos,), (object_qvel,) = addresses.object_qpos, addresses.object_qvel
            qpos[object_qpos], qvel[object_qvel] = settled.object_qpos, settled.object_qvel
        # Gymnasium-Robotics leaves its mocap body at the origin until the first action moves it.
        return StartState(qpos, qvel, np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0)))
