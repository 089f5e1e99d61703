"""What a goal task observes of the gripper and the object, in the order of `layout`.

There are two observers, one fast for one simulation and one fast for many.
"""

import math
from collections.abc import Sequence

import mujoco
import mujoco.batch
import numpy as np

from fetch_composer.tasks import layout
from fetch_composer.tasks.addresses import Addresses

# Below this cosine of the middle angle the first and third Euler axes coincide.
_SINGULAR_COSINE = 4 * np.finfo(np.float64).eps

_AT_REST = (0.0, 0.0)


def euler_xyz(xmat: Sequence[float]) -> tuple[float, float, float]:
    """Returns the intrinsic XYZ Euler angles, in rad, of a row-major rotation matrix.

    Args:
        xmat: (9,) floats, as MuJoCo's `site_xmat`.
    """
    m00, m01, m02, m10, m11, m12, _, _, m22 = xmat
    cosine = math.hypot(m12, m22)
    middle = math.atan2(m02, cosine)
    if cosine > _SINGULAR_COSINE:
        return math.atan2(-m12, m22), middle, math.atan2(-m01, m00)
    return 0.0, middle, math.atan2(m10, m11)


def euler_xyz_batch(xmat: np.ndarray) -> np.ndarray:
    """Returns what `euler_xyz` returns for each of many matrices.

    Args:
        xmat: (n, 9) row-major rotation matrices.

    Returns:
        (n, 3) angles in rad.
    """
    m00, m01, m02, m10, m11, m12, _, _, m22 = xmat.T
    cosine = np.hypot(m12, m22)
    regular = cosine > _SINGULAR_COSINE
    return np.stack(
        (
            np.where(regular, np.arctan2(-m12, m22), 0.0),
            np.arctan2(m02, cosine),
            np.where(regular, np.arctan2(-m01, m00), np.arctan2(m10, m11)),
        ),
        axis=-1,
    )


class GoalObserver:
    """Reads observations off a simulation; resolves every name once."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        addresses: Addresses,
        control_timestep: float,
        object_minus_gripper: bool,
    ) -> None:
        """Initializes the observer.

        Args:
            model: The compiled model.
            data: The simulation to observe.
            addresses: Where things are in the model. Fingers that are rigid have no joints;
                their displacements and velocities are observed as 0.
            control_timestep: Seconds by which velocities are multiplied.
            object_minus_gripper: Sense of the difference of positions.
        """
        grip_site, object_site = addresses.grip_site, addresses.object_site
        self._model = model
        self._data = data
        self._grip_site = grip_site
        self._object_site = object_site
        self._timestep = control_timestep
        self._sense = 1.0 if object_minus_gripper else -1.0
        self._grip_position = data.site_xpos[grip_site]
        self._qvel = data.qvel
        self._fingers = data.qpos[addresses.finger_qpos]
        self._finger_velocities = data.qvel[addresses.finger_qvel]
        # All Jacobians in one array, so that one product gives all velocities.
        num_rows = 3 if object_site is None else 9
        self._jacobian = np.zeros((num_rows, model.nv))
        self._grip_jacobian = self._jacobian[:3]
        if object_site is not None:
            self._object_position = data.site_xpos[object_site]
            self._object_xmat = data.site_xmat[object_site]
            self._object_jacobians = (self._jacobian[3:6], self._jacobian[6:])

    def achieved_goal(self) -> np.ndarray:
        """Returns (3,) position in m of the object or, without one, of the gripper."""
        if self._object_site is None:
            return self._grip_position.copy()
        return self._object_position.copy()

    def observation(self) -> np.ndarray:
        """Returns (25,) or, without an object, (10,) float64, as `layout` has it."""
        # Plain floats: for so few numbers each operation on an array costs more than all of these.
        model, data, sense = self._model, self._data, self._sense
        mujoco.mj_jacSite(model, data, self._grip_jacobian, None, self._grip_site)
        fingers, finger_velocities = self._observe_fingers()
        gx, gy, gz = grip = self._grip_position.tolist()
        if self._object_site is None:
            grip_velocity = (self._jacobian @ self._qvel * self._timestep).tolist()
            return np.array((*grip, *fingers, *grip_velocity, *finger_velocities))
        mujoco.mj_jacSite(model, data, *self._object_jacobians, self._object_site)
        velocities = (self._jacobian @ self._qvel * self._timestep).tolist()
        vx, vy, vz, ux, uy, uz, *spin = velocities
        x, y, z = place = self._object_position.tolist()
        return np.array((
            *grip, *place, (x - gx) * sense, (y - gy) * sense, (z - gz) * sense, *fingers,
            *euler_xyz(self._object_xmat.tolist()), ux - vx, uy - vy, uz - vz, *spin,
            vx, vy, vz, *finger_velocities,
        ))  # fmt: skip

    def _observe_fingers(self):
        """Returns displacements and velocities of the right and the left finger."""
        if not self._fingers.size:
            return _AT_REST, _AT_REST
        return self._fingers.tolist(), (self._finger_velocities * self._timestep).tolist()


class _SiteMotion:
    """Velocities of a site in every simulation of a batch, from its body's degrees of freedom."""

    def __init__(self, model: mujoco.MjModel, sims: mujoco.batch.Batch, site: int) -> None:
        body = model.site_bodyid[site]
        moving: list[int] = []
        while body:
            first, count = model.body_dofadr[body], model.body_dofnum[body]
            moving = [*range(first, first + count), *moving]
            body = model.body_parentid[body]
        self._dofs = np.array(moving)
        self._root = model.body_rootid[model.site_bodyid[site]]
        self._site = site
        self._cdof, self._qvel = sims.bind('cdof'), sims.bind('qvel')
        self._site_xpos, self._centre = sims.bind('site_xpos'), sims.bind('subtree_com')

    def velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (n, 3) linear velocity in m/s and (n, 3) angular velocity in rad/s."""
        qvel = self._qvel[:, np.newaxis, self._dofs]
        spatial = (qvel @ self._cdof[:, self._dofs])[:, 0]
        arm = self._site_xpos[:, self._site] - self._centre[:, self._root]
        angular, at_centre = spatial[:, :3], spatial[:, 3:]
        return at_centre + np.cross(angular, arm), angular


class BatchObserver:
    """`GoalObserver` for every simulation of a batch at once: arrays of shape (n, ...)."""

    def __init__(
        self,
        model: mujoco.MjModel,
        sims: mujoco.batch.Batch,
        addresses: Addresses,
        control_timestep: float,
        object_minus_gripper: bool,
    ) -> None:
        """Initializes the observer; the arguments are those of `GoalObserver`."""
        grip_site, object_site = addresses.grip_site, addresses.object_site
        self._num_sims = sims.nsim
        self._timestep = control_timestep
        self._sense = 1.0 if object_minus_gripper else -1.0
        self._layout = layout.WITHOUT_OBJECT if object_site is None else layout.WITH_OBJECT
        self._fingers = sims.bind('qpos')[:, addresses.finger_qpos]
        self._finger_velocities = sims.bind('qvel')[:, addresses.finger_qvel]
        self._grip_position = sims.bind('site_xpos')[:, grip_site]
        self._grip_motion = _SiteMotion(model, sims, grip_site)
        self._has_object = object_site is not None
        if object_site is not None:
            self._object_position = sims.bind('site_xpos')[:, object_site]
            self._object_xmat = sims.bind('site_xmat')[:, object_site]
            self._object_motion = _SiteMotion(model, sims, object_site)

    def achieved_goal(self) -> np.ndarray:
        """Returns (n, 3) positions in m of the objects or, without one, of the grippers."""
        return (self._object_position if self._has_object else self._grip_position).copy()

    def observation(self) -> np.ndarray:
        """Returns (n, 25) or, without an object, (n, 10) float64, as `layout` has it."""
        at = self._layout
        out = np.zeros((self._num_sims, at.size))
        grip_velocity, _ = self._grip_motion.velocities()
        out[:, at.grip_position] = self._grip_position
        out[:, at.grip_velocity] = grip_velocity * self._timestep
        if self._has_object:
            velocity, angular_velocity = self._object_motion.velocities()
            out[:, at.object_position] = self._object_position
            relative = self._object_position - self._grip_position
            out[:, at.relative_position] = relative * self._sense
            out[:, at.object_rotation] = euler_xyz_batch(self._object_xmat)
            out[:, at.object_velocity] = (velocity - grip_velocity) * self._timestep
            out[:, at.object_spin] = angular_velocity * self._timestep
        if self._fingers.size:
            out[:, at.fingers] = self._fingers
            out[:, at.finger_velocities] = self._finger_velocities * self._timestep
        return out
