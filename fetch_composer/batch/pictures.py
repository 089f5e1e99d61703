"""What cameras see of the environments of a batch, which itself has nothing that can be seen."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dm_env import specs

from fetch_composer import tasks
from fetch_composer.environment import Environment
from fetch_composer.tasks import pixels
from fetch_composer.tasks.state import State


class BatchPictures:
    """Pictures as single environments observe them, drawn where an environment has changed.

    A simulation takes on the state of one environment after the other.
    """

    def __init__(self, task: str, task_kwargs: Mapping[str, Any], count: int) -> None:
        """Compiles the simulation that is drawn.

        Args:
            task: Name of the task.
            task_kwargs: Its options, with an `observation_mode` that observes pictures.
            count: How many environments there are.
        """
        task_made = tasks.make(task, **task_kwargs)
        self._env = Environment(task_made, random_state=0)
        self._env.reset()
        observed = task_made.task_observables
        self._names = [
            name for name, each in observed.items() if isinstance(each, pixels.CameraObservable)
        ]
        self._goal_names = {
            name for name in self._names if isinstance(observed[name], pixels.GoalCameraObservable)
        }
        physics, random_state = self._env.physics, np.random.RandomState(0)
        self._take = {
            name: observed[name].observation_callable(physics, random_state) for name in self._names
        }
        self._pictures = {
            name: np.zeros((count, *spec.shape), spec.dtype) for name, spec in self.spec().items()
        }
        self._has_changed = np.ones(count, dtype=bool)
        self._has_new_goal = np.ones(count, dtype=bool)

    def spec(self) -> dict[str, specs.Array]:
        """Returns the specs of one environment's pictures."""
        spec = self._env.observation_spec()
        return {name: spec[name] for name in self._names}

    def forget(self, rows: Any, goals: bool) -> None:
        """Has pictures of some environments drawn anew when they are next observed.

        Args:
            rows: Indices of the environments; ... for all.
            goals: Whether pictures of their goals are, too.
        """
        self._has_changed[rows] = True
        if goals:
            self._has_new_goal[rows] = True

    def observation(self, state: Callable[[int], State]) -> dict[str, np.ndarray]:
        """Returns pictures of all environments, (count, height, width, ...), new arrays.

        Args:
            state: Returns the state of the environment of an index.
        """
        for i in np.flatnonzero(self._has_changed).tolist():
            self._env.set_state(state(i))
            for name, take in self._take.items():
                if self._has_new_goal[i] or name not in self._goal_names:
                    self._pictures[name][i] = take()
        self._has_changed[:] = self._has_new_goal[:] = False
        return {name: pictures.copy() for name, pictures in self._pictures.items()}

    def close(self) -> None:
        """Frees the simulation; closing twice does no harm."""
        self._env.close()
