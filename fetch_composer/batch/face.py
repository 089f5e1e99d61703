"""What every batch of environments has, whatever steps it: names, specs, and an end."""

from typing import Any

from dm_env import specs

from fetch_composer import tasks


class BatchFace:
    """A batch of environments of one task.

    A subclass sets `_num_envs`, `_task_name` and `_options`, and sets `_is_closed` when it closes.
    """

    _num_envs: int
    _task_name: str
    _options: tasks.TaskOptions
    _is_closed = False

    @property
    def num_envs(self) -> int:
        """How many environments there are."""
        return self._num_envs

    @property
    def task_name(self) -> str:
        """Name of the task."""
        return self._task_name

    @property
    def options(self) -> tasks.TaskOptions:
        """The options of the task."""
        return self._options

    @property
    def convention(self) -> str:
        """Name of the convention."""
        return self._options.convention

    def single_action_spec(self) -> specs.BoundedArray:
        """Returns the spec of one environment's action, shape (4,) by default."""
        raise NotImplementedError

    def single_observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of one environment's observations."""
        raise NotImplementedError

    def action_spec(self) -> specs.BoundedArray:
        """Returns the spec of `step`'s argument, shape (num_envs, 4) by default."""
        return self._batched(self.single_action_spec())

    def observation_spec(self) -> dict[str, specs.Array]:
        """Returns the specs of a time step's observations."""
        single = self.single_observation_spec()
        return {name: self._batched(spec) for name, spec in single.items()}

    def _batched(self, spec: Any) -> Any:
        return spec.replace(shape=(self._num_envs, *spec.shape))

    def close(self) -> None:
        """Frees the simulations; closing twice does no harm, and nothing else works afterwards."""
        raise NotImplementedError

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError('This batch is closed; make another.')

    def __reduce_ex__(self, protocol):
        raise TypeError(
            'A batch holds live simulations and cannot be copied or pickled: make another one in '
            'its place, with the same arguments and seed.'
        )

    def __enter__(self):
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()
