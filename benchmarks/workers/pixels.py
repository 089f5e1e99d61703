"""Control steps of a Push, or of a batch, that observes pictures, or bare ones with as many."""

import os
from typing import Any

os.environ['MUJOCO_GL'] = 'egl'  # The meters switch OpenGL off, since nothing else renders.

import mujoco  # noqa: E402

import fetch_composer  # noqa: E402
from benchmarks.workers import protocol, rounds  # noqa: E402

_CAMERA = 'corner'


def build(num_steps: int, size: int, method: str, num_envs: int = 1):
    """Returns what measures one round.

    Args:
        num_steps: Control steps in a round, each with a picture of every environment.
        size: Height and width of the picture in pixels.
        method: 'environment', 'batch', or 'bare' for MuJoCo's own renderer after
            `mj_step(nstep=20)`.
        num_envs: How many environments a batch has.
    """
    options: dict[str, Any] = {
        'seed': 0,
        'observation_mode': 'features+pixels',
        'pixels': {'cameras': _CAMERA, 'height': size, 'width': size},
    }
    if method == 'batch':
        batch = fetch_composer.BatchEnvironment('push', num_envs, **options)

        def start_batch(episode: int):
            batch.seed(episode * num_envs)
            batch.reset()
            return rounds.episode_actions(episode, num_envs)

        return rounds.Stepping(start_batch, batch.step, num_steps, num_envs)

    env = fetch_composer.load('push', **options)

    def start_episode(episode: int):
        env.seed(episode)
        env.reset()
        return rounds.episode_actions(episode)

    if method == 'environment':
        return rounds.Stepping(start_episode, env.step, num_steps)

    env.reset()
    model, data = env.physics.model.ptr, env.physics.data.ptr
    renderer = mujoco.Renderer(model, size, size)
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False

    def step(action):
        del action  # Unused.
        mujoco.mj_step(model, data, nstep=20)
        renderer.update_scene(data, _CAMERA)
        renderer.render()

    return rounds.Stepping(start_episode, step, num_steps)


if __name__ == '__main__':
    protocol.serve(build)
