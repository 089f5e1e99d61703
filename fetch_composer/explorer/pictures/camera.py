"""A camera, which takes pictures of an environment."""

import numpy as np


class Camera:
    """Takes pictures of an environment."""

    def __init__(self, env, name: str, width: int, height: int) -> None:
        """Initializes the camera.

        Args:
            env: A Composer environment.
            name: Name of a camera in its model.
            width: Width of a picture in pixels.
            height: Height of a picture in pixels.

        Raises:
            ValueError: if there is no such camera; the message lists those that there are.
        """
        model = env.physics.model
        names = [model.camera(index).name for index in range(model.ncam)]
        if name not in names:
            raise ValueError(f'Unknown camera {name!r}; valid are {", ".join(names)}.')
        self._env = env
        self._name = name
        self._width = width
        self._height = height

    def picture(self) -> np.ndarray:
        """Returns (height, width, 3) uint8."""
        # The model's buffer is as large as the largest picture must be; it is allocated with
        # the first one, and anew whenever an environment is compiled again.
        buffer = self._env.physics.model.vis.global_
        buffer.offwidth = max(buffer.offwidth, self._width)
        buffer.offheight = max(buffer.offheight, self._height)
        return self._env.physics.render(self._height, self._width, camera_id=self._name)
