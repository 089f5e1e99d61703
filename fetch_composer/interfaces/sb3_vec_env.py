"""The native batch as a vectorized environment of Stable-Baselines3.

env = SB3VecEnv(gym.make_vec('fetch_composer/FetchPush-v2', num_envs=16))
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise ImportError("It needs Stable-Baselines3: pip install 'fetch_composer[sb3]'.") from error


class SB3VecEnv(VecEnv):
    """Steps all environments in one native call.

    Where an episode ends, the observation returned is the first of the next one, and the last one
    is in `infos[i]['terminal_observation']`.
    """

    metadata: dict[str, Any]

    def __init__(self, env: gymnasium.vector.VectorEnv) -> None:
        """Wraps what `gym.make_vec` returns for an id of this package.

        Raises:
            ValueError: if its autoreset mode is `SAME_STEP`, which hides how episodes end.
        """
        if env.metadata['autoreset_mode'] == gymnasium.vector.AutoresetMode.SAME_STEP:
            raise ValueError(
                'SB3VecEnv starts episodes itself: leave autoreset_mode at NEXT_STEP, its default.'
            )
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = {**self.metadata, 'render_fps': env.metadata['render_fps']}

    def reset(self) -> dict[str, np.ndarray]:
        """Starts an episode everywhere, with what `seed` and `set_options` were given."""
        seeds = None if None in self._seeds else self._seeds
        names = {name for each in self._options for name in each}
        options = {name: np.stack([each[name] for each in self._options]) for name in names}
        observation, info = self.env.reset(seed=seeds, options=options)
        self.reset_infos = [{'is_success': each} for each in info['is_success']]
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keeps the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self):
        """Advances every environment by one control step."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{'is_success': each} for each in info['is_success']]
        for i, each in enumerate(infos):
            each['TimeLimit.truncated'] = bool(truncated[i] and not terminated[i])
            if done[i]:
                each['terminal_observation'] = {key: row[i] for key, row in observation.items()}
        if done.any():
            observation, _ = self.env.reset(options={'reset_mask': done})
        return observation, reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[Any]:
        """Returns a picture of each environment in the `render_ids` of `gym.make_vec`."""
        pictures = self.env.render()
        return () if pictures is None else pictures

    def close(self) -> None:
        """Frees the simulations."""
        self.env.close()

    def get_attr(self, attr_name, indices=None) -> list[Any]:
        """Returns an attribute, which all environments have in common."""
        return [getattr(self.env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None) -> None:
        """Sets an attribute of all environments."""
        if indices is not None:
            raise ValueError('Attributes are common to all environments; indices must be None.')
        setattr(self.env, attr_name, value)

    def env_method(self, method_name, *args, indices=None, **kwargs) -> list[Any]:
        """Returns what a method, such as `compute_reward`, returns for each index."""
        method = getattr(self.env, method_name)
        return [method(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None) -> list[bool]:
        """Returns False for each index: there are no environments to wrap one by one."""
        return [False for _ in self._get_indices(indices)]
