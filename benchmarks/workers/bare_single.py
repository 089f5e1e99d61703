"""Bare `mj_step` on our model: the mocap positions of our own episodes, replayed.

The replay ends in the very state in which the environment ended, so the physics is the same and
what the environment adds is all that differs.
"""

import functools

import mujoco
import numpy as np

import fetch_composer
from benchmarks.workers import protocol, recording, rounds


def build(num_steps: int, resets: bool = False):
    """Returns what measures one round of so many control steps, and of resets if asked for.

    Raises:
        RuntimeError: if a replay ends elsewhere than the environment did.
    """
    env = fetch_composer.load('push', seed=0)
    substeps = env.task.physics_steps_per_control_step
    model = env.physics.model.ptr
    data = mujoco.MjData(model)
    mocap_position, mj_step = data.mocap_pos[0], mujoco.mj_step

    @functools.cache
    def record(episode: int) -> recording.Recording:
        return recording.record(env, episode, rounds.episode_actions(episode))

    started: list[recording.Recording] = []

    def start_episode(episode: int):
        started[:] = [record(episode)]
        recording.restore(model, data, *started)
        return started[0].mocap_positions

    def reset() -> None:
        mujoco.mj_resetData(model, data)
        recording.restore(model, data, *started)
        mujoco.mj_forward(model, data)

    def step(position: np.ndarray) -> None:
        mocap_position[:] = position
        mj_step(model, data, nstep=substeps)

    for position in start_episode(0):
        step(position)
    if not np.array_equal(data.qpos, record(0).last_qpos):
        raise RuntimeError('The replay does not end where the environment did.')
    return rounds.Stepping(start_episode, step, num_steps, reset=reset if resets else None)


if __name__ == '__main__':
    protocol.serve(build)
