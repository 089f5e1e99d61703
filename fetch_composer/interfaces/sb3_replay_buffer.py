"""Hindsight for Stable-Baselines3 and SBX that shows how objects move.

TD3('MultiInputPolicy', env, replay_buffer_class=MovedHerReplayBuffer, ...)
"""

from __future__ import annotations  # The site is made without Stable-Baselines3.

import numpy as np

from fetch_composer.tasks.movement import has_moved

try:
    import torch
    from stable_baselines3 import HerReplayBuffer
    from stable_baselines3.common.type_aliases import DictReplayBufferSamples
    from stable_baselines3.common.vec_env import VecNormalize
except ImportError as error:
    raise ImportError("It needs Stable-Baselines3: pip install 'fetch_composer[sb3]'.") from error


class MovedHerReplayBuffer(HerReplayBuffer):
    """A `HerReplayBuffer` that takes a share of transitions from episodes that moved an object.

    Few episodes of random actions do. In hindsight the others are at their goal from the first step
    to the last, whatever the gripper does, and by themselves they teach just that.

    Transitions come in random order. Those of `HerReplayBuffer` have goals in hindsight last, and
    SBX cuts the batches of several updates from one draw: most of them would have no other goals.
    """

    ep_length: np.ndarray

    def __init__(self, *args, moved_share: float = 0.5, **kwargs) -> None:
        """Initializes an empty buffer.

        Args:
            *args: As for `HerReplayBuffer`.
            moved_share: Share of transitions, from 0 to 1, that is drawn from episodes that moved
                an object, once there is one; the others are drawn from all episodes.
            **kwargs: As for `HerReplayBuffer`.

        Raises:
            ValueError: if `moved_share` is not from 0 to 1.
        """
        if not 0 <= moved_share <= 1:
            raise ValueError(f'moved_share must be from 0 to 1, got {moved_share!r}.')
        super().__init__(*args, **kwargs)
        self._moved_share = moved_share
        self._has_moved = np.zeros(self.ep_length.shape, dtype=bool)
        self._length_of_moved: np.ndarray | None = None  # As `ep_length`; None if it is not known.

    def add(self, *args, **kwargs) -> None:
        """Keeps a transition of every environment, as `HerReplayBuffer` does."""
        super().add(*args, **kwargs)
        self._length_of_moved = None

    def _compute_episode_length(self, env_idx: int) -> None:
        """Takes note of an episode that has just ended."""
        start = self._current_ep_start[env_idx]
        super()._compute_episode_length(env_idx)
        steps = (start + np.arange(self.ep_length[start, env_idx])) % self.buffer_size
        path = self.observations['achieved_goal'][steps, env_idx]
        self._has_moved[steps, env_idx] = has_moved(path)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> DictReplayBufferSamples:
        """Draws transitions.

        Args:
            batch_size: How many.
            env: What normalises observations and rewards, if anything does.
        """
        if self._length_of_moved is None:  # Several draws may follow one step.
            self._length_of_moved = np.where(self._has_moved, self.ep_length, 0)
        has_any = bool(self._length_of_moved.any())
        count = round(self._moved_share * batch_size) if has_any else 0
        parts = [super().sample(batch_size - count, env)] if count < batch_size else []
        if count:
            # The parent draws from episodes whose length is not 0.
            length, self.ep_length = self.ep_length, self._length_of_moved
            try:
                parts.append(super().sample(count, env))
            finally:
                self.ep_length = length
        order = np.random.permutation(batch_size)
        fields = zip(*parts, strict=True)
        return DictReplayBufferSamples(*(_in_order(order, *values) for values in fields))


def _in_order(order: np.ndarray, *values):
    """Returns tensors, or dictionaries of them, as one, with rows in an order; None of None."""
    if values[0] is None:
        return None
    if isinstance(values[0], dict):
        return {key: _in_order(order, *(each[key] for each in values)) for key in values[0]}
    return torch.cat(values)[torch.as_tensor(order)]
