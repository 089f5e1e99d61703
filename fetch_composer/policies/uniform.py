"""The policy that knows nothing: actions drawn uniformly from all that are allowed."""

from collections.abc import Mapping

import numpy as np
from dm_env import specs

from fetch_composer.policies import streams


class UniformPolicy:
    """Draws every action uniformly between the bounds of an action spec."""

    def __init__(self, action_spec: specs.BoundedArray, seed: int | None = None) -> None:
        """Initializes the policy.

        Args:
            action_spec: Shape, dtype and bounds of an action.
            seed: A non-negative integer, or None for entropy from the operating system.
        """
        self._spec = action_spec
        self._generator = streams.generator(seed, streams.UNIFORM)

    def reset(self) -> None:
        """Does nothing: the draws go on, so that episodes differ."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, whatever the observation."""
        del observation  # Unused.
        action = self._generator.uniform(
            self._spec.minimum, self._spec.maximum, size=self._spec.shape
        )
        return action.astype(self._spec.dtype)
