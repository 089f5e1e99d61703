"""What a policy is, and what it may know of the environment that it acts in."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from dm_env import specs

from fetch_composer.tasks import action_modes, checks


class ActionError(ValueError):
    """A policy's action does not fit the environment."""


class Policy(Protocol):
    """What chooses actions."""

    def reset(self) -> None:
        """Forgets the episode so far; call it at the start of each."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) by default, float32 in [-1, 1], for an observation."""


class BatchPolicy(Policy, Protocol):
    """A policy that can act for many environments in one call.

    It keeps nothing from one step to the next, so that one object serves all of them.
    """

    def act_on_batch(self, observations: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns actions, (n, 4) by default, for n observations, (n, ...) by name.

        Each row is what the policy returns when it is called with that row, to the bit, whatever
        other rows there are: episodes must not depend on what runs beside them.
        """


@dataclasses.dataclass(frozen=True)
class PolicyContext:
    """What a policy may know of its environment: names and specs, and nothing of the simulation.

    Attributes:
        task_name: Name of the task.
        convention: 'documented' or 'gymnasium_robotics'.
        action_spec: Spec of an action.
        observation_spec: Specs of an observation, by name.
        action_mode: What its actions ask for.
    """

    task_name: str
    convention: str
    action_spec: specs.BoundedArray
    observation_spec: Mapping[str, specs.Array]
    action_mode: str = action_modes.DISPLACEMENT.name

    @classmethod
    def of(cls, env) -> 'PolicyContext':
        """Returns the context of a single environment, as `fetch_composer.load` returns it."""
        return cls(
            env.task.name,
            env.task.convention.name,
            env.action_spec(),
            env.observation_spec(),
            env.task.options.action_mode,
        )

    def check_default_action_mode(self, policy_name: str) -> None:
        """Raises `ValueError` if a policy that displaces the gripper is to act in another mode."""
        default = action_modes.DISPLACEMENT.name
        if self.action_mode != default:
            raise ValueError(
                f'The policy {policy_name} is for the action_mode {default!r} alone, not for '
                f'{self.action_mode!r}; valid for every one are random, zero.'
            )


def as_action(value: Any) -> np.ndarray:
    """Returns what a policy has given as an array.

    Raises:
        ActionError: if values in it are masked, or it has no shape.
    """
    try:
        return checks.array('The action of the policy', value)
    except ValueError as error:
        raise ActionError(str(error)) from None


def check_shape(action: np.ndarray, needed: tuple[int, ...]) -> None:
    """Raises `ActionError`, which says what is needed, if an action has another shape or kind."""
    if action.shape != needed:
        raise ActionError(
            f'The policy gives an action of shape {action.shape}; {needed} is needed.'
        )
    if not checks.is_numeric(action):
        raise ActionError(f'The policy gives an action of {action.dtype}; floats are needed.')


def check_action(
    policy: Policy, observation: Mapping[str, np.ndarray], context: PolicyContext
) -> None:
    """Lets a policy act once; its action must fit the environment.

    Args:
        policy: A policy of its own, since it is reset and acts once.
        observation: An observation of the environment.
        context: What is known of the environment.

    Raises:
        ActionError: if the action does not fit; the message says why.
    """
    policy.reset()
    action = as_action(policy({name: value.copy() for name, value in observation.items()}))
    check_shape(action, context.action_spec.shape)
