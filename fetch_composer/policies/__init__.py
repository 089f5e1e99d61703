"""Policies to run on the Fetch tasks, by name."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from fetch_composer.policies.pick_and_place_expert import PickAndPlaceExpert
from fetch_composer.policies.push_expert import PushExpert
from fetch_composer.policies.reach_expert import ReachExpert
from fetch_composer.policies.slide_expert import SlideExpert
from fetch_composer.policies.uniform import UniformPolicy
from fetch_composer.policies.zero import ZeroPolicy

__all__ = ('ALL', 'Policy', 'load')


class Policy(Protocol):
    """What chooses actions."""

    def reset(self) -> None:
        """Forgets the episode so far; call it at the start of each."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32 in [-1, 1], for an environment's observation."""


_EXPERTS: dict[str, type[Policy]] = {
    'pick_and_place': PickAndPlaceExpert,
    'push': PushExpert,
    'reach': ReachExpert,
    'slide': SlideExpert,
}


def _expert(env, seed) -> Policy:
    del seed  # Unused.
    if env.task.name not in _EXPERTS:
        others = ', '.join(sorted(set(ALL) - {'expert'}))
        raise ValueError(
            f'There is no expert for the task {env.task.name!r}, only for {", ".join(_EXPERTS)}; '
            f'valid for every task are {others}.'
        )
    return _EXPERTS[env.task.name]()


_POLICIES = {
    'expert': _expert,
    'random': lambda env, seed: UniformPolicy(env.action_spec(), seed),
    'zero': lambda env, seed: ZeroPolicy(env.action_spec()),
}
ALL = tuple(_POLICIES)


def load(name: str, env: Any, seed: int | None = None) -> Policy:
    """Returns a policy.

    Args:
        name: One of `ALL`: 'expert', 'random' or 'zero'.
        env: The environment that it will act in, as `fetch_composer.load` returns it.
        seed: A non-negative integer for a policy that draws, or None. It may be the
            environment's own seed: their draws are independent.

    Raises:
        ValueError: if there is no such policy, or none for this task; the message lists the
            valid ones.
    """
    if name not in _POLICIES:
        raise ValueError(f'Unknown policy {name!r}; valid are {", ".join(ALL)}.')
    return _POLICIES[name](env, seed)
