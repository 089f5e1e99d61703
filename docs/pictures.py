"""Makes the still pictures of the README and the docs: `python docs/pictures.py`."""

import os
import pathlib

os.environ.setdefault('MUJOCO_GL', 'egl')

import imageio.v3 as iio  # noqa: E402
import numpy as np  # noqa: E402
from dm_control.composer.variation import distributions  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import policies  # noqa: E402

_FOLDER = pathlib.Path(__file__).parent
_VARIATIONS = {
    'object_size': distributions.Uniform((0.02, 0.02, 0.015), (0.035, 0.035, 0.03)),
    'object_color': distributions.Uniform((0, 0, 0), (1, 1, 1)),
    'light_position': distributions.Uniform((1, -1, 2.5), (3, 2, 3.5)),
    'camera_offset': distributions.Uniform((-0.1,) * 3, (0.1,) * 3),
    'gripper_offset': distributions.Uniform((-0.08,) * 3, (0.08,) * 3),
}


def _push() -> np.ndarray:
    """Returns a picture of the expert while it pushes."""
    env = fetch_composer.load('push', seed=3)
    policy = policies.load('expert', env)
    policy.reset()
    observation = env.reset().observation
    for _ in range(22):
        observation = env.step(policy(observation)).observation
    return env.physics.render(540, 960, camera_id='corner')


def _variations() -> np.ndarray:
    """Returns three by three pictures of starts."""
    env = fetch_composer.load('push', seed=0, variations=_VARIATIONS)
    pictures = []
    for _ in range(9):
        env.reset()
        pictures.append(env.physics.render(240, 320, camera_id='corner'))
    return np.vstack([np.hstack(pictures[i : i + 3]) for i in (0, 3, 6)])


def main() -> None:
    for name, picture in (('fetch_push', _push()), ('variations', _variations())):
        path = _FOLDER / f'{name}.png'
        iio.imwrite(path, picture)
        print(f'{path.name}: {path.stat().st_size / 1000:.0f} KB')


if __name__ == '__main__':
    main()
