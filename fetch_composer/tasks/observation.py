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
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)


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
        current: bool = True,
    ) -> None:
        """Initializes the observer.

        Args:
            model: The compiled model.
            data: The simulation to observe.
            addresses: Where things are in the model. Fingers that are rigid have no joints;
                their displacements and velocities are observed as 0.
            control_timestep: Seconds by which velocities are multiplied.
            object_minus_gripper: Sense of the difference of positions.
            current: Whether the velocities of bodies are up to date, as `mj_comVel` leaves them.
                If not, they follow from the state's velocities and the Jacobians at hand.
        """
        grip_site, object_site = addresses.grip_site, addresses.object_site
        self._model = model
        self._data = data
        self._grip_site = grip_site
        self._object_site = object_site
        self._timestep = control_timestep
        self._sense = 1.0 if object_minus_gripper else -1.0
        self._grip_position = data.site_xpos[grip_site]
        self._fingers = data.qpos[addresses.finger_qpos]
        self._finger_velocities = data.qvel[addresses.finger_qvel]
        self._velocity = self._velocity_of_body if current else self._velocity_by_jacobian
        self._spatial = np.zeros(6)
        self._jacobians = np.zeros((6, model.nv))
        # Position of the object or, without one, of the gripper: (3,) in m, live.
        self.achieved_position = self._grip_position
        if object_site is not None:
            self.achieved_position = data.site_xpos[object_site]
            self._object_xmat = data.site_xmat[object_site]

    def achieved_goal(self) -> np.ndarray:
        """Returns (3,) position in m of the object or, without one, of the gripper."""
        return self.achieved_position.copy()

    def observation(self) -> np.ndarray:
        """Returns (25,) or, without an object, (10,) float64, as `layout` has it."""
        # Plain floats: for so few numbers each operation on an array costs more than all of these.
        sense, dt = self._sense, self._timestep
        gx, gy, gz = self._grip_position.tolist()
        _, _, _, vx, vy, vz = self._velocity(self._grip_site)
        vx, vy, vz = vx * dt, vy * dt, vz * dt
        fx, fy = fu, fv = _AT_REST
        if self._fingers.size:
            fx, fy = self._fingers.tolist()
            fu, fv = self._finger_velocities.tolist()
            fu, fv = fu * dt, fv * dt
        if self._object_site is None:
            return np.array((gx, gy, gz, fx, fy, vx, vy, vz, fu, fv))
        x, y, z = self.achieved_position.tolist()
        wx, wy, wz, ux, uy, uz = self._velocity(self._object_site)
        return np.array((
            gx, gy, gz, x, y, z, (x - gx) * sense, (y - gy) * sense, (z - gz) * sense, fx, fy,
            *euler_xyz(self._object_xmat.tolist()),
            ux * dt - vx, uy * dt - vy, uz * dt - vz, wx * dt, wy * dt, wz * dt,
            vx, vy, vz, fu, fv,
        ))  # fmt: skip

    def _velocity_of_body(self, site: int) -> list[float]:
        """Returns a site's angular velocity in rad/s and its linear velocity in m/s."""
        mujoco.mj_objectVelocity(self._model, self._data, _SITE, site, self._spatial, 0)
        return self._spatial.tolist()

    def _velocity_by_jacobian(self, site: int) -> list[float]:
        jacobians = self._jacobians
        mujoco.mj_jacSite(self._model, self._data, jacobians[3:], jacobians[:3], site)
        return (jacobians @ self._data.qvel).tolist()


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
