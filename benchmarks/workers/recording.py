"""What our environment tells the physics in an episode, so that bare MuJoCo can replay it."""

import dataclasses

import mujoco
import numpy as np

from fetch_composer.environment import Environment

# Everything that the next physics step depends on, the solver's warm start included.
_WHOLE_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclasses.dataclass(frozen=True)
class Recording:
    """An episode of the documented convention, in which only the mocap body's position varies.

    Attributes:
        start: (n,) the simulation's `mjSTATE_INTEGRATION` before the first control step.
        physics_start: (m,) the part of it that is `mjSTATE_FULLPHYSICS`.
        mocap_positions: (steps, 3) position of the mocap body in each control step, in m.
        mocap_quaternion: (4,) its orientation.
        last_qpos: (nq,) where the simulation ends.
    """

    start: np.ndarray
    physics_start: np.ndarray
    mocap_positions: np.ndarray
    mocap_quaternion: np.ndarray
    last_qpos: np.ndarray


def record(env: Environment, seed: int, actions: np.ndarray) -> Recording:
    """Returns the episode of a seed.

    Args:
        env: An environment of the documented convention.
        seed: Seed of the episode.
        actions: (steps, 4) actions.
    """
    env.seed(seed)
    env.reset()
    model, data = env.physics.model.ptr, env.physics.data.ptr
    start = get_state(model, data, _WHOLE_STATE)
    physics_start = get_state(model, data, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    positions = []
    for action in actions:
        env.step(action)
        positions.append(data.mocap_pos[0].copy())
    return Recording(
        start=start,
        physics_start=physics_start,
        mocap_positions=np.array(positions),
        mocap_quaternion=data.mocap_quat[0].copy(),
        last_qpos=data.qpos.copy(),
    )


def get_state(model: mujoco.MjModel, data: mujoco.MjData, spec: mujoco.mjtState) -> np.ndarray:
    """Returns a part of a simulation's state."""
    state = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, state, spec)
    return state


def restore(model: mujoco.MjModel, data: mujoco.MjData, recording: Recording) -> None:
    """Puts a simulation where a recording starts."""
    mujoco.mj_setState(model, data, recording.start, _WHOLE_STATE)
