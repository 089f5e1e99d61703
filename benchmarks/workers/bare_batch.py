"""Bare MuJoCo on many threads with our model: our own episodes' mocap poses, replayed.

Either by `mujoco.rollout`, where each control step starts from the state that the one before
returned, or by `mujoco.batch`, which keeps the states itself and is what our batch stands on.
"""

import functools

import mujoco
import mujoco.batch
import mujoco.rollout
import numpy as np

import fetch_composer
from benchmarks.workers import protocol, recording, rounds

# Recording takes longer than measuring; a few episodes are replayed again and again, and in more
# environments than so many the same ones.
_DISTINCT_EPISODES = 2
_DISTINCT_ENVS = 256

_MOCAP_POSE = mujoco.mjtState.mjSTATE_MOCAP_POS | mujoco.mjtState.mjSTATE_MOCAP_QUAT


class _Recorder:
    """The recordings of a whole batch."""

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.env = fetch_composer.load('push', seed=0)
        self.model = self.env.physics.model.ptr
        self.substeps = self.env.task.physics_steps_per_control_step

    @functools.cache  # noqa: B019
    def record(self, episode: int) -> list[recording.Recording]:
        actions = rounds.episode_actions(episode, self.num_envs)
        recorded = [
            recording.record(self.env, episode * self.num_envs + i, actions[:, i])
            for i in range(min(self.num_envs, _DISTINCT_ENVS))
        ]
        return [recorded[i % len(recorded)] for i in range(self.num_envs)]


def _by_rollout(recorder: _Recorder, num_threads: int):
    model, substeps = recorder.model, recorder.substeps
    models = [model] * recorder.num_envs
    data = [mujoco.MjData(model) for _ in range(num_threads)]
    pool = mujoco.rollout.Rollout(nthread=num_threads if num_threads > 1 else 0)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states = np.zeros((recorder.num_envs, substeps, size))
    initial = np.zeros((recorder.num_envs, size))
    starts = np.zeros((recorder.num_envs, size))

    def reset() -> None:
        initial[:] = starts

    def start_episode(episode: int) -> list[np.ndarray]:
        recorded = recorder.record(episode % _DISTINCT_EPISODES)
        starts[:] = [each.physics_start for each in recorded]
        reset()
        positions = np.stack([each.mocap_positions for each in recorded], axis=1)
        controls = []
        for position in positions:
            quaternion = [each.mocap_quaternion for each in recorded]
            pose = np.concatenate((position, quaternion), axis=-1)
            controls.append(np.repeat(pose[:, np.newaxis], substeps, axis=1))
        return controls

    def step(control: np.ndarray) -> None:
        pool.rollout(
            models,
            data,
            initial,
            control,
            control_spec=int(_MOCAP_POSE),
            skip_checks=True,
            nstep=substeps,
            state=states,
        )
        initial[:] = states[:, -1]

    return start_episode, step, reset


def _by_batch(recorder: _Recorder, num_threads: int):
    sims = mujoco.batch.Batch(recorder.model, recorder.num_envs, nthread=num_threads)
    mocap_positions = sims.bind('mocap_pos')[:, 0]
    starts = np.zeros_like(sims.state)

    def reset() -> None:
        sims.state[:] = starts

    def start_episode(episode: int) -> np.ndarray:
        recorded = recorder.record(episode % _DISTINCT_EPISODES)
        starts[:] = [each.start for each in recorded]
        reset()
        return np.stack([each.mocap_positions for each in recorded], axis=1)

    def step(positions: np.ndarray) -> None:
        mocap_positions[:] = positions
        sims.step(nstep=recorder.substeps)

    return start_episode, step, reset


_METHODS = {'rollout': _by_rollout, 'batch': _by_batch}


def build(
    num_steps: int, num_envs: int, num_threads: int, method: str = 'rollout', resets: bool = False
):
    """Returns what measures one round.

    Args:
        num_steps: Control steps of the whole batch in a round.
        num_envs: How many simulations.
        num_threads: How many threads share them.
        method: 'rollout' or 'batch'.
        resets: Whether putting states back between episodes is timed, too.
    """
    start_episode, step, reset = _METHODS[method](_Recorder(num_envs), num_threads)
    return rounds.Stepping(start_episode, step, num_steps, num_envs, reset if resets else None)


if __name__ == '__main__':
    protocol.serve(build)
