"""Control steps of a Push that observes pictures, or bare control steps with as many pictures."""

import os

os.environ['MUJOCO_GL'] = 'egl'  # The meters switch OpenGL off, since nothing else renders.

import mujoco  # noqa: E402

import fetch_composer  # noqa: E402
from benchmarks.workers import protocol, rounds  # noqa: E402

_CAMERA = 'corner'


def build(num_steps: int, size: int, method: str):
    """Returns what measures one round.

    Args:
        num_steps: Control steps in a round, each with one picture.
        size: Height and width of the picture in pixels.
        method: 'environment', or 'bare' for MuJoCo's own renderer after `mj_step(nstep=20)`.
    """
    env = fetch_composer.load(
        'push',
        seed=0,
        observation_mode='features+pixels',
        pixels={'cameras': _CAMERA, 'height': size, 'width': size},
    )

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
