"""The policy that asks for no motion."""

from collections.abc import Mapping

import numpy as np
from dm_env import specs


class ZeroPolicy:
    """Returns zeros: `documented` holds the gripper still then; the other lets it drift."""

    def __init__(self, action_spec: specs.Array) -> None:
        """Initializes the policy with the shape and dtype of an action."""
        self._spec = action_spec

    def reset(self) -> None:
        """Does nothing: there is nothing to reset."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, whatever the observation."""
        del observation  # Unused.
        return np.zeros(self._spec.shape, self._spec.dtype)
