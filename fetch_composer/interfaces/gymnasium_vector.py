"""Many environments of one task as a Gymnasium vector environment: the native batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fetch_composer.batch import BatchEnvironment
from fetch_composer.interfaces import gymnasium_common
from fetch_composer.interfaces.gymnasium_common import gymnasium
from fetch_composer.tasks.state import State


class FetchVectorEnv(gymnasium_common.GoalFunctions, gymnasium.vector.VectorEnv):
    """Many environments of one task on native threads, as a `gymnasium.vector.VectorEnv`.

    A finished environment starts its next episode in the following call of `step`.
    """

    metadata = {
        'render_modes': [],
        'render_fps': gymnasium_common.RENDER_FPS,
        'autoreset_mode': gymnasium.vector.AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, task: str, num_envs: int, num_threads: int | None = None, **task_kwargs
    ) -> None:
        """Initializes the environments.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            num_envs: How many environments.
            num_threads: Threads that share them; by default one for each processor.
            **task_kwargs: Options of the task; see `tasks.TaskOptions`. Episodes are truncated
                only if `max_episode_steps` is given here, or by `gym.make_vec`.

        Raises:
            ValueError: if an argument is not valid; the message lists what is.
        """
        task_kwargs.setdefault('max_episode_steps', None)
        self._batch = BatchEnvironment(task, num_envs, num_threads, **task_kwargs)
        self.num_envs = num_envs
        self._reward_type = self._batch.options.reward_type
        self.single_action_space, self.single_observation_space = gymnasium_common.spaces_of(
            self._batch.single_action_spec(), self._batch.single_observation_spec()
        )
        batch_space = gymnasium.vector.utils.batch_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @property
    def batch(self) -> BatchEnvironment:
        """The `BatchEnvironment` behind these."""
        return self._batch

    def reset(self, *, seed=None, options: dict[str, Any] | None = None):
        """Starts an episode in every environment.

        Args:
            seed: If given, environment i is seeded with seed + i; or one seed for each.
            options: `object_position`, (2,) or (n, 2) in m, and `goal`, (3,) or (n, 3) in m,
                where they are not to be sampled; and `reset_mask`, (num_envs,) booleans: which
                n of the environments to reset, where it is not all.

        Raises:
            ValueError: if an option is unknown or a place cannot be; nothing has changed.
        """
        options = dict(options or {})
        mask = options.pop('reset_mask', None)
        options = gymnasium_common.check_options(options, ('reset_mask',))
        time_step = self._batch.reset(mask, seed=seed, **options)
        if seed is not None and np.ndim(seed) == 0:
            super().reset(seed=int(seed))
        return time_step.observation, self._info(time_step)

    def step(self, actions):
        """Advances every environment by one control step; see `BatchEnvironment.step`."""
        time_step = self._batch.step(actions)
        terminated = np.zeros(self.num_envs, dtype=bool)
        truncated = time_step.step_type == 2
        return (
            time_step.observation,
            time_step.reward,
            terminated,
            truncated,
            self._info(time_step),
        )

    def get_states(self, ids=None) -> list[State]:
        """Returns the states of all environments, or of some; see `BatchEnvironment`."""
        return self._batch.get_states(ids)

    def set_states(self, states: Sequence[State], ids=None) -> None:
        """Restores states, each in an environment; see `BatchEnvironment`."""
        self._batch.set_states(states, ids)

    def _info(self, time_step) -> dict[str, np.ndarray]:
        achieved, desired = (time_step.observation[k] for k in ('achieved_goal', 'desired_goal'))
        return {
            'is_success': gymnasium_common.success_info(achieved, desired),
            '_is_success': np.ones(self.num_envs, dtype=bool),
        }

    def close_extras(self, **unused_kwargs) -> None:
        """Frees the simulations."""
        self._batch.close()
