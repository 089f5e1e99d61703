"""Policies that are given as they are, such as a model while it is being trained."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fetch_composer.policies.files import code_policy, sb3_policy
from fetch_composer.policies.protocol import Policy, PolicyContext, as_action


class VectorizedPolicy:
    """Asks for the actions of all environments in one call."""

    def __init__(self, act_on_batch: Callable, reset: Callable[[], Any] | None = None) -> None:
        """Initializes the policy.

        Args:
            act_on_batch: Takes observations, (n, size) by name, and returns actions, (n, ...).
            reset: Called at the start of each episode, if given.
        """
        self._act_on_batch = act_on_batch
        self._reset = reset

    def reset(self) -> None:
        """Resets what was given, if there is something to reset."""
        if self._reset is not None:
            self._reset()

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action."""
        return self.act_on_batch({name: value[None] for name, value in observation.items()})[0]

    def act_on_batch(self, observations: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns actions, a row each."""
        return as_action(self._act_on_batch(observations))


def factory(
    policy: Any, context: PolicyContext, vectorized: bool = False
) -> Callable[[int | None], Policy]:
    """Returns what makes a policy for each seed.

    Args:
        policy: A model of Stable-Baselines3; an object with a method `act_on_batch`; or what
            `files.code_policy` takes: a function of an observation, or what makes a policy.
        context: What is known of the environment.
        vectorized: Whether it is a function of the observations of many environments, (n, ...).

    Raises:
        ValueError: if it is none of them, or does not fit the environment.
    """
    if vectorized:
        return _always(VectorizedPolicy(policy))
    if hasattr(policy, 'act_on_batch') and not isinstance(policy, type):
        return _always(VectorizedPolicy(policy.act_on_batch, getattr(policy, 'reset', None)))
    if sb3_policy.is_model(policy):
        return _always(sb3_policy.of_model(policy, name(policy), context))
    return code_policy.of_code(policy, name(policy), context)


def keeps_state(policy: Any) -> bool:
    """Returns whether a policy may remember its episode, so that it acts in one at a time."""
    return (
        hasattr(policy, 'reset')
        and not isinstance(policy, type)
        and not hasattr(policy, 'act_on_batch')
    )


def name(policy: Any) -> str:
    """Returns what to call a policy."""
    return getattr(policy, '__name__', None) or type(policy).__name__


def _always(policy: Policy) -> Callable[[int | None], Policy]:
    return lambda seed: policy
