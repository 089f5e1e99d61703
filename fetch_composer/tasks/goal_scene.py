"""The scene with objects and gripper at the goal, for pictures of it."""

from collections.abc import Sequence

import mujoco
import numpy as np
from absl import logging
from dm_control import mjcf
from dm_control.utils import inverse_kinematics

from fetch_composer.tasks import conventions
from fetch_composer.tasks.addresses import Addresses
from fetch_composer.tasks.clearance import FINGERTIP_DEPTH
from fetch_composer.tasks.scene import Scene
from fetch_composer.tasks.starts import EpisodeStarts, Start
from fetch_composer.tasks.variations import Variations

_REACH = 0.95  # m along the floor, from the shoulder's axis to a gripper at any height.
_MAX_ERROR = 1e-4  # m and rad


class GoalScene:
    """A simulation beside that of a task, which nothing steps.

    They share their model, and so the targets and whatever varies. The objects are at their goals.
    A free gripper holds the last of them, a locked one stands on it; without any the gripper is at
    the goal itself. Where the gripper cannot be, as at the goals of Slide, it is where episodes
    start.
    """

    def __init__(
        self,
        physics: mjcf.Physics,
        scene: Scene,
        addresses: Addresses,
        starts: EpisodeStarts,
        variations: Variations,
        locked_gripper: bool,
    ) -> None:
        """Makes the simulation.

        Args:
            physics: That of the task.
            scene: The entities.
            addresses: Where they are in the model.
            starts: Where episodes start.
            variations: What differs between them.
            locked_gripper: Whether the gripper stays closed.
        """
        self.physics = physics.copy(share_model=True)
        self._scene, self._addresses = scene, addresses
        self._starts, self._variations = starts, variations
        self._locked_gripper = locked_gripper

    def show(self, start: Start) -> None:
        """Places objects and gripper at the goal of an episode, if one has started."""
        if start.goal is None:
            return
        self._usual_qpos = self._starts.usual_qpos(start)
        data, addresses = self.physics.data, self._addresses
        places = start.goal.reshape(-1, 3)
        grip_position = places[-1]
        if not self._scene.objects:
            self._reach(grip_position)
        else:
            _, half_width, half_height = self._variations.solids(start.variations)[-1].half_extents
            if self._locked_gripper:
                grip_position = grip_position + (0.0, 0.0, half_height + FINGERTIP_DEPTH)
            if self._reach(grip_position) and not self._locked_gripper:
                data.qpos[addresses.finger_qpos] = half_width
            for each, place, where in zip(
                self._scene.objects, places, addresses.object_qpos, strict=True
            ):
                data.qpos[where] = (*place, *each.quaternion)
        self._update()

    def _reach(self, position: np.ndarray) -> bool:
        """Brings the grip site to a position if it can; otherwise the gripper is at its start.

        It points down or, where the arm does not allow for that, is tilted.
        """
        for quaternion in (conventions.POINTING_DOWN, None):
            self._place_as_usual()
            shoulder = self.physics.bind(self._scene.arm.joints[0]).xanchor
            if np.linalg.norm((position - shoulder)[:2]) > _REACH:
                return False
            if self._solve(position, quaternion) < _MAX_ERROR:
                return True
        self._place_as_usual()
        return False

    def _place_as_usual(self) -> None:
        self.physics.data.qpos[:] = self._usual_qpos
        self._update()

    def _solve(self, position: np.ndarray, quaternion: Sequence[float] | None) -> float:
        """Moves the arm and returns the error, in m and rad, that is left."""
        verbosity = logging.get_verbosity()
        logging.set_verbosity(logging.ERROR)  # It warns of what it cannot reach.
        try:
            return inverse_kinematics.qpos_from_site_pose(
                self.physics,
                self._scene.gripper.tool_center_point.full_identifier,
                target_pos=position,
                target_quat=quaternion,
                joint_names=[joint.full_identifier for joint in self._scene.arm.joints],
                inplace=True,
            ).err_norm
        finally:
            logging.set_verbosity(verbosity)

    def _update(self) -> None:
        mujoco.mj_fwdPosition(self.physics.model.ptr, self.physics.data.ptr)
