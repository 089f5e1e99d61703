"""Pictures of the environments of a batch, which itself has nothing that can be seen."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer import tasks
from fetch_composer.environment import Environment
from fetch_composer.tasks import camera
from fetch_composer.tasks.state import State


class RowRenderer:
    """Draws one environment after the other with a simulation that takes on the state of each.

    A picture is that of a single environment in the same state.
    """

    def __init__(
        self,
        task: str,
        task_kwargs: Mapping[str, Any],
        **camera_kwargs: Any,
    ) -> None:
        """Compiles the simulation that is drawn.

        Args:
            task: Name of the task of the batch.
            task_kwargs: Options of its task.
            **camera_kwargs: What a `tasks.camera.Camera` takes.

        Raises:
            ValueError: if there is no such camera; the message lists those that there are.
        """
        self._env = Environment(tasks.make(task, **task_kwargs), random_state=0)
        self._env.reset()
        self._camera = camera.Camera(self._env.physics, **camera_kwargs)

    def pictures(self, states: Sequence[State]) -> tuple[np.ndarray, ...]:
        """Returns a picture, (height, width, 3) uint8, of each state."""
        return tuple(self._of(state).picture() for state in states)

    def depths(self, states: Sequence[State]) -> tuple[np.ndarray, ...]:
        """Returns distances in m, (height, width) float32, of each state."""
        return tuple(self._of(state).depth() for state in states)

    def _of(self, state: State) -> camera.Camera:
        self._env.set_state(state)
        return self._camera

    def close(self) -> None:
        """Frees the simulation; closing twice does no harm."""
        self._env.close()
