"""What a goal task observes of the gripper and the objects, in the order of `layout`.

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
    cosine = math.sqrt(m12 * m12 + m22 * m22)
    if cosine > _SINGULAR_COSINE:
        sines, cosines = (-m12, m02, -m01), (m22, cosine, m00)
    else:
        sines, cosines = (0.0, m02, m10), (1.0, cosine, m11)
    # NumPy's, as in a batch and in Gymnasium-Robotics: that of `math` rounds otherwise.
    return tuple(np.arctan2(sines, cosines).tolist())


def euler_xyz_batch(xmat: np.ndarray) -> np.ndarray:
    """Returns what `euler_xyz` returns for each of many matrices.

    Args:
        xmat: (n, 9) row-major rotation matrices.

    Returns:
        (n, 3) angles in rad.
    """
    m00, m01, m02, m10, m11, m12, _, _, m22 = xmat.T
    cosine = np.sqrt(m12 * m12 + m22 * m22)
    angles = np.empty((len(xmat), 3))
    np.arctan2(-m12, m22, out=angles[:, 0])
    np.arctan2(m02, cosine, out=angles[:, 1])
    np.arctan2(-m01, m00, out=angles[:, 2])
    singular = np.flatnonzero(cosine <= _SINGULAR_COSINE)
    if singular.size:
        angles[singular, 0] = 0.0
        angles[singular, 2] = np.arctan2(m10[singular], m11[singular])
    return angles


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
                If not, they follow from the state's velocities and the joints' axes at hand.
        """
        grip_site, object_sites = addresses.grip_site, addresses.object_sites
        self._model = model
        self._data = data
        self._grip_site = grip_site
        self._timestep = control_timestep
        self._sense = 1.0 if object_minus_gripper else -1.0
        self._grip_position = data.site_xpos[grip_site]
        self._fingers = data.qpos[addresses.finger_qpos]
        self._finger_velocities = data.qvel[addresses.finger_qvel]
        self._velocity = self._velocity_of_body if current else self._velocity_by_axes
        self._spatial = np.zeros(6)
        self._movers = {site: movers(model, site) for site in (grip_site, *object_sites)}
        # Site, position and rotation matrix of each object; the latter two are live.
        self._objects = [
            (site, data.site_xpos[site], data.site_xmat[site]) for site in object_sites
        ]
        self._achieved = [position for _, position, _ in self._objects] or [self._grip_position]

    def achieved_goal(self) -> np.ndarray:
        """Returns (3 n,) positions in m of the objects or, without one, of the gripper."""
        if len(self._achieved) == 1:
            return self._achieved[0].copy()
        return np.concatenate(self._achieved)

    def achieved(self) -> list[float]:
        """Returns the same as plain floats."""
        if len(self._achieved) == 1:
            return self._achieved[0].tolist()
        return np.concatenate(self._achieved).tolist()

    def observation(self) -> np.ndarray:
        """Returns (n,) float64, as `layout` has it."""
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
        if len(self._objects) != 1:
            of_objects: list[float] = []
            for site, position, xmat in self._objects:
                x, y, z = position.tolist()
                wx, wy, wz, ux, uy, uz = self._velocity(site)
                of_objects += (
                    x, y, z, (x - gx) * sense, (y - gy) * sense, (z - gz) * sense,
                    *euler_xyz(xmat.tolist()),
                    ux * dt - vx, uy * dt - vy, uz * dt - vz, wx * dt, wy * dt, wz * dt,
                )  # fmt: skip
            return np.array([gx, gy, gz, fx, fy, vx, vy, vz, fu, fv, *of_objects])
        site, position, xmat = self._objects[0]
        x, y, z = position.tolist()
        wx, wy, wz, ux, uy, uz = self._velocity(site)
        return np.array((
            gx, gy, gz, x, y, z, (x - gx) * sense, (y - gy) * sense, (z - gz) * sense, fx, fy,
            *euler_xyz(xmat.tolist()),
            ux * dt - vx, uy * dt - vy, uz * dt - vz, wx * dt, wy * dt, wz * dt,
            vx, vy, vz, fu, fv,
        ))  # fmt: skip

    def _velocity_of_body(self, site: int) -> list[float]:
        """Returns a site's angular velocity in rad/s and its linear velocity in m/s."""
        mujoco.mj_objectVelocity(self._model, self._data, _SITE, site, self._spatial, 0)
        return self._spatial.tolist()

    def _velocity_by_axes(self, site: int) -> list[float]:
        """Returns the same, in the arithmetic of `mj_comVel` and `mj_objectVelocity`."""
        data = self._data
        dofs, root = self._movers[site]
        spatial = np.einsum('d,dk->k', data.qvel[dofs], data.cdof[dofs])
        wx, wy, wz, ux, uy, uz = spatial.tolist()
        x, y, z = (data.site_xpos[site] - data.subtree_com[root]).tolist()
        return [wx, wy, wz, ux - (y * wz - z * wy), uy - (z * wx - x * wz), uz - (x * wy - y * wx)]


class _SiteMotions:
    """Velocities of sites in every simulation of a batch, as `mj_objectVelocity` has them."""

    def __init__(
        self, model: mujoco.MjModel, sims: mujoco.batch.Batch, sites: Sequence[int]
    ) -> None:
        """Looks up what moves each site.

        Args:
            model: The compiled model.
            sims: The simulations.
            sites: Ids of the sites.
        """
        self._sources = []
        axes, qvel = sims.bind('cdof'), sims.bind('qvel')
        positions, centres = sims.bind('site_xpos'), sims.bind('subtree_com')
        for site in sites:
            dofs, root = movers(model, site)
            # A slice needs no copy; joints of the head lie between those of torso and arm.
            contiguous = np.ptp(dofs) == len(dofs) - 1
            chosen = slice(dofs[0], dofs[-1] + 1) if contiguous else dofs
            self._sources.append((axes, qvel, chosen, positions[:, site], centres[:, root]))
        # Components first, so that each is contiguous.
        shape = (len(sites), sims.nsim)
        self._spatial = np.zeros((6, *shape))
        self._arms = np.zeros((3, *shape))
        self._linear = np.zeros((3, *shape))

    def velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns the sites' linear velocities in m/s and angular ones in rad/s, (3, sites, n).

        They are buffers, which the next call writes to.
        """
        spatial, arms, linear = self._spatial, self._arms, self._linear
        for i, (axes, qvel, dofs, position, centre) in enumerate(self._sources):
            # In the order in which `mj_comVel` adds them up, and so to the same bits.
            np.einsum('nd,ndk->kn', qvel[:, dofs], axes[:, dofs], out=spatial[:, i])
            np.subtract(position.T, centre.T, out=arms[:, i])
        for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            turned = arms[y] * spatial[z] - arms[z] * spatial[y]
            np.subtract(spatial[3 + x], turned, out=linear[x])
        return linear, spatial[:3]


def movers(model: mujoco.MjModel, site: int) -> tuple[np.ndarray, int]:
    """Returns the degrees of freedom that move a site, from the world to it, and their root."""
    moving: list[int] = []
    body = model.site_bodyid[site]
    root = model.body_rootid[body]
    while body:
        first, count = model.body_dofadr[body], model.body_dofnum[body]
        moving = [*range(first, first + count), *moving]
        body = model.body_parentid[body]
    return np.array(moving), root


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
        grip_site, object_sites = addresses.grip_site, addresses.object_sites
        self._num_sims = sims.nsim
        self._timestep = control_timestep
        self._sense = 1.0 if object_minus_gripper else -1.0
        self._layouts = layout.of(len(object_sites))
        self._fingers = sims.bind('qpos')[:, addresses.finger_qpos]
        self._finger_velocities = sims.bind('qvel')[:, addresses.finger_qvel]
        self._motions = _SiteMotions(model, sims, [grip_site, *object_sites])
        positions, xmats = sims.bind('site_xpos'), sims.bind('site_xmat')
        self._grip_position = positions[:, grip_site]
        self._objects = [(positions[:, site], xmats[:, site]) for site in object_sites]
        self._achieved = [position for position, _ in self._objects] or [self._grip_position]

    def achieved_goal(self) -> np.ndarray:
        """Returns (n, 3 objects) positions in m of objects or, without one, of grippers."""
        if len(self._achieved) == 1:
            return self._achieved[0].copy()
        return np.concatenate(self._achieved, axis=1)

    def observation(self) -> np.ndarray:
        """Returns (n, size) float64, as `layout` has it."""
        at, dt = self._layouts[0], self._timestep
        out = np.zeros((self._num_sims, at.size))
        linear, angular = self._motions.velocities()
        linear *= dt
        out[:, at.grip_position] = self._grip_position
        out[:, at.grip_velocity] = linear[:, 0].T
        for i, (position, xmat) in enumerate(self._objects):
            place = self._layouts[i]
            out[:, place.object_position] = position
            relative = out[:, place.relative_position]
            np.subtract(position, self._grip_position, out=relative)
            relative *= self._sense
            out[:, place.object_rotation] = euler_xyz_batch(xmat)
            np.subtract(linear[:, 1 + i].T, linear[:, 0].T, out=out[:, place.object_velocity])
            np.multiply(angular[:, 1 + i].T, dt, out=out[:, place.object_spin])
        if self._fingers.size:
            out[:, at.fingers] = self._fingers
            np.multiply(self._finger_velocities, dt, out=out[:, at.finger_velocities])
        return out
