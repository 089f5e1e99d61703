"""Many environments of one task as a Gymnasium vector environment: the native batch."""

from collections.abc import Sequence
from typing import Any

import dm_env
import numpy as np

from fetch_composer.batch import BatchEnvironment
from fetch_composer.batch.row_renderer import RowRenderer
from fetch_composer.interfaces import gymnasium_common
from fetch_composer.interfaces.gymnasium_common import AutoresetMode, gymnasium
from fetch_composer.tasks import checks
from fetch_composer.tasks.state import State

_RENDER_MODES = ('rgb_array', 'depth_array')


class FetchVectorEnv(gymnasium_common.GoalFunctions, gymnasium.vector.VectorEnv):
    """Many environments of one task on native threads, as a `gymnasium.vector.VectorEnv`.

    What happens to an environment whose episode has ended is Gymnasium's autoreset mode:
    `NEXT_STEP` starts its next episode in the following call of `step`, `SAME_STEP` in the same
    one, and with `DISABLED` it must be reset before it is stepped again.
    """

    metadata = {
        'render_modes': list(_RENDER_MODES),
        'render_fps': gymnasium_common.RENDER_FPS,
        'autoreset_mode': AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        task: str,
        num_envs: int,
        num_threads: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        render_ids=None,
        width: int = 480,
        height: int = 480,
        camera_name: str = 'corner',
        supersampling: int = 1,
        **task_kwargs,
    ) -> None:
        """Initializes the environments.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            num_envs: How many environments.
            num_threads: Threads that share them; by default one for each processor.
            autoreset_mode: An `AutoresetMode` of Gymnasium, or its value.
            render_mode: 'rgb_array' for (height, width, 3) uint8 images, 'depth_array' for
                (height, width) float32 distances in m, or None.
            render_ids: Which environments `render` returns images of: their indices, or a mask of
                shape (num_envs,); None for all, which Gymnasium's own wrappers need.
            width: Width of images in pixels.
            height: Height of images in pixels.
            camera_name: A camera of the model, such as 'front' or 'fetch/head_camera'.
            supersampling: A pixel is the mean of as many squared: 2 smooths edges.
            **task_kwargs: Options of the task; see `tasks.TaskOptions`. Episodes are truncated
                only if `max_episode_steps` is given here, or by `gym.make_vec`.

        Raises:
            ValueError: if an argument is not valid; the message lists what is.
        """
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {**self.metadata, 'autoreset_mode': self.autoreset_mode}
        if render_mode is not None:
            checks.one_of('render_mode', render_mode, _RENDER_MODES)
        self.render_mode = render_mode
        task_kwargs.setdefault('max_episode_steps', None)
        self._batch = BatchEnvironment(task, num_envs, num_threads, **task_kwargs)
        self.num_envs = self._batch.num_envs
        self._task_options = self._batch.options
        self._render_ids = checks.ids(render_ids, self.num_envs)
        picture: dict[str, Any] = gymnasium_common.picture_options(width, height, supersampling)
        self._renderer: RowRenderer | None = None
        if render_mode is not None:
            self._renderer = RowRenderer(task, task_kwargs, name=camera_name, **picture)
        self.single_action_space, self.single_observation_space = gymnasium_common.spaces_of(
            self._batch.single_action_spec(), self._batch.single_observation_spec()
        )
        batch_space = gymnasium.vector.utils.batch_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    @property
    def batch(self) -> BatchEnvironment:
        """The `BatchEnvironment` behind these."""
        return self._batch

    def reset(self, *, seed=None, options: dict[str, Any] | None = None):
        """Starts an episode in every environment.

        Args:
            seed: If given, environment i is seeded with seed + i; or one seed for each, or None
                in place of one. Those that are not reset go on with their draws.
            options: `object_position`, (2,) or (n, 2) in m, and `goal`, (3,) or (n, 3) in m,
                where they are not to be sampled; and `reset_mask`, (num_envs,) booleans: which
                n of the environments to reset, where it is not all.

        Raises:
            ValueError: if an option is unknown or a place cannot be; nothing has changed.
        """
        options = gymnasium_common.check_options(options, ('reset_mask',))
        mask = options.pop('reset_mask', None)
        if mask is not None:
            checks.mask('reset_mask', mask, self.num_envs)
        time_step = self._batch.reset(mask, seed=seed, **options)
        if seed is not None and np.ndim(seed) == 0:
            super().reset(seed=int(seed))
        ids = checks.ids(mask, self.num_envs)
        return time_step.observation, self._info(time_step.observation, ids)

    def step(self, actions):
        """Advances every environment by one control step; see `BatchEnvironment.step`.

        Raises:
            ValueError: if an action is not valid; no environment has moved.
            RuntimeError: if the autoreset mode is `DISABLED` and an episode has ended.
        """
        if self.autoreset_mode == AutoresetMode.DISABLED:
            self._check_running()
        time_step = self._batch.step(actions)
        observation, done = time_step.observation, time_step.step_type == dm_env.StepType.LAST
        terminated = done & (time_step.discount == 0)
        at_limit = self._batch.steps_taken == self._task_options.max_episode_steps
        truncated = done & (~terminated | at_limit)
        info: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and done.any():
            info = self._final(observation, np.flatnonzero(done))
            observation = self._batch.reset(done).observation
        info.update(self._info(observation))
        return observation, time_step.reward, terminated, truncated, info

    def _check_running(self) -> None:
        over = np.flatnonzero(self._batch.is_over).tolist()
        if over:
            raise RuntimeError(
                f'The episodes of environments {over} have ended: with the autoreset mode '
                "DISABLED reset them, as with reset(options={'reset_mask': mask})."
            )

    def _final(self, observation, ids: np.ndarray) -> dict[str, Any]:
        """Returns what the info of a step has of episodes that start anew within it."""
        final = np.full(self.num_envs, None, dtype=object)
        for i in ids:
            final[i] = {name: rows[i].copy() for name, rows in observation.items()}
        mask = self._mask(ids)
        return {
            'final_obs': final,
            '_final_obs': mask,
            'final_info': self._info(observation, ids),
            '_final_info': mask.copy(),
        }

    def get_states(self, ids=None) -> list[State]:
        """Returns the states of all environments, or of some; see `BatchEnvironment`."""
        return self._batch.get_states(ids)

    def set_states(self, states: Sequence[State], ids=None) -> None:
        """Restores states, each in an environment; see `BatchEnvironment`."""
        self._batch.set_states(states, ids)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Returns an image of each environment in `render_ids`, or None without a render mode."""
        if self._renderer is None:
            gymnasium.logger.warn(
                'render() needs a render_mode, such as gym.make_vec(..., render_mode="rgb_array").'
            )
            return None
        states = self._batch.get_states(self._render_ids)
        if self.render_mode == 'depth_array':
            return self._renderer.depths(states)
        return self._renderer.pictures(states)

    def _info(self, observation, ids=...) -> dict[str, np.ndarray]:
        """Returns the info of some environments; that of others is 0, as Gymnasium has it."""
        success = np.zeros(self.num_envs, dtype=np.float32)
        success[ids] = gymnasium_common.success_info(
            observation['achieved_goal'][ids], observation['desired_goal'][ids]
        )
        return {'is_success': success, '_is_success': self._mask(ids)}

    def _mask(self, ids) -> np.ndarray:
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[ids] = True
        return mask

    def close_extras(self, **unused_kwargs) -> None:
        """Frees the simulations."""
        self._batch.close()
        if self._renderer is not None:
            self._renderer.close()


def _autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        valid = ', '.join(repr(each.value) for each in AutoresetMode)
        raise ValueError(f'Unknown autoreset_mode {mode!r}; valid are {valid}.') from None
