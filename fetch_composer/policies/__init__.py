"""Policies to run on the Fetch tasks, by name or from a file."""

import hashlib
import pathlib
import re
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from fetch_composer.policies.experts.pick_and_place import PickAndPlaceExpert
from fetch_composer.policies.experts.push import PushExpert
from fetch_composer.policies.experts.reach import ReachExpert
from fetch_composer.policies.experts.slide import SlideExpert
from fetch_composer.policies.files import code_policy, onnx_policy, sb3_policy
from fetch_composer.policies.uniform import UniformPolicy
from fetch_composer.policies.zero import ZeroPolicy

__all__ = ('ALL', 'ActionError', 'Policy', 'check', 'digest', 'factory', 'load')

_CODE = re.compile(r'[A-Za-z_][\w.]*:[A-Za-z_][\w.]*')


class ActionError(ValueError):
    """A policy gave an action that is none."""


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


def load(name: str, env: Any, seed: int | None = None, trust_pickle: bool = False) -> Policy:
    """Returns a policy.

    Args:
        name: One of `ALL`; or a file, PATH.onnx or PATH.zip (of Stable-Baselines3); or code,
            `module:function` (see `code_policy`).
        env: The environment that it will act in, as `fetch_composer.load` returns it.
        seed: A non-negative integer for a policy that draws, or None. It may be the
            environment's own seed: their draws are independent.
        trust_pickle: Whether code within a zip file may run.

    Raises:
        ValueError: if there is no such policy, none for this task, or one that does not fit it;
            the message lists what is valid.
    """
    return factory(name, env, trust_pickle)(seed)


def factory(name: str, env: Any, trust_pickle: bool = False) -> Callable[[int | None], Policy]:
    """Returns what makes a policy for each seed, and reads its file once.

    Args:
        name: As for `load`.
        env: As for `load`; anything with its `task`, `action_spec` and `observation_spec` will
            do for policies that are not code.
        trust_pickle: As for `load`.

    Raises:
        ValueError: as `load` does.
    """
    if name in _POLICIES:
        _POLICIES[name](env, None)
        return lambda seed: _POLICIES[name](env, seed)
    if name.endswith('.onnx'):
        return onnx_policy.factory(name, env)
    if name.endswith('.zip'):
        return sb3_policy.factory(name, env, trust_pickle)
    if _CODE.fullmatch(name):
        return code_policy.factory(name, env)
    raise ValueError(
        f'Unknown policy {name!r}; valid are {", ".join(ALL)}, PATH.onnx, PATH.zip of '
        'Stable-Baselines3, and module:function.'
    )


def check(policy: Policy, observation: Mapping[str, np.ndarray], env: Any) -> None:
    """Raises `ActionError`, which says what is wrong, if a policy's action does not fit.

    Args:
        policy: A policy of its own, since it is reset and acts once.
        observation: An observation of the environment.
        env: The environment.
    """
    policy.reset()
    action = np.asarray(policy({name: value.copy() for name, value in observation.items()}))
    needed = env.action_spec().shape
    if action.shape != needed:
        raise ActionError(
            f'The policy gives an action of shape {action.shape}; {needed} is needed.'
        )
    if action.dtype.kind not in 'fiu':
        raise ActionError(f'The policy gives an action of {action.dtype}; floats are needed.')


def digest(name: str) -> str | None:
    """Returns a digest of the file that a policy comes from; None for one of `ALL`.

    Of code, which has to be loaded first, it is that of the function's module alone.
    """
    if name in _POLICIES:
        return None
    path = name if name.endswith(('.onnx', '.zip')) else code_policy.source(name)
    if path is None:
        return None
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
