"""Policies that miss: Gaussian noise on every action of another policy.

The name of such a policy is that of the other one and its noise: `expert~0.2`.
"""

import numbers
import sys
from collections.abc import Mapping

import numpy as np
from dm_env import specs

from fetch_composer.policies import streams
from fetch_composer.policies.protocol import Policy, as_action, check_shape
from fetch_composer.tasks import checks

_SIGN = '~'


class NoisyPolicy:
    """Adds noise to the actions of a policy, and clips them to what is allowed."""

    def __init__(
        self,
        policy: Policy,
        action_spec: specs.BoundedArray,
        noise: float,
        seed: int | None = None,
    ) -> None:
        """Initializes the policy.

        Args:
            policy: Whose actions they are.
            action_spec: Shape, dtype and bounds of an action.
            noise: Standard deviation, where the bounds are -1 and 1; of others, a share of half
                their distance.
            seed: A non-negative integer, or None for entropy from the operating system.

        Raises:
            ValueError: if the noise is not a finite number from 0.
        """
        check(noise)
        self._policy = policy
        self._spec = action_spec
        self._deviation = noise * (action_spec.maximum - action_spec.minimum) / 2
        self._generator = streams.generator(seed, streams.NOISE)

    def reset(self) -> None:
        """Resets the policy; the noise goes on, so that episodes differ."""
        self._policy.reset()

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32."""
        action = as_action(self._policy(observation))
        check_shape(action, self._spec.shape)  # One of another shape would be repeated to fit.
        noisy = action + self._deviation * self._generator.standard_normal(self._spec.shape)
        return np.clip(noisy, self._spec.minimum, self._spec.maximum).astype(self._spec.dtype)


def check(noise: float) -> None:
    """Raises `ValueError` if that can be no standard deviation."""
    is_number = isinstance(noise, numbers.Real) and not isinstance(noise, bool)
    if not is_number or not 0 <= noise <= sys.float_info.max:
        raise ValueError(f'noise must be a finite number from 0; got {checks.shown(noise)}.')


def split(name: str) -> tuple[str, float | None]:
    """Returns the name of the policy without noise, and the noise; None if there is none."""
    policy, sign, text = name.rpartition(_SIGN)
    try:
        return (policy, float(text)) if sign else (name, None)
    except ValueError:  # A file with such a sign in its name.
        return name, None


def joined(name: str, noise: float) -> str:
    """Returns the name of a policy with noise."""
    check(noise)
    return f'{name}{_SIGN}{float(noise)!r}' if noise else name
