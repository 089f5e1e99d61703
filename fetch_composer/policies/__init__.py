"""Policies to run on the Fetch tasks, by name or from a file."""

import hashlib
import pathlib
import re
from collections.abc import Callable
from typing import Any

from fetch_composer.policies import given
from fetch_composer.policies.experts import EXPERTS
from fetch_composer.policies.files import code_policy, onnx_policy, sb3_policy, trained
from fetch_composer.policies.protocol import (
    ActionError,
    BatchPolicy,
    Policy,
    PolicyContext,
    check_action,
    check_shape,
)
from fetch_composer.policies.uniform import UniformPolicy
from fetch_composer.policies.zero import ZeroPolicy

__all__ = (
    'ALL',
    'ActionError',
    'BatchPolicy',
    'Policy',
    'PolicyContext',
    'PolicyFactory',
    'check_action',
    'check_shape',
    'digest',
    'factory',
    'given',
    'load',
)

PolicyFactory = Callable[[int | None], Policy]

_CODE = re.compile(r'[A-Za-z_][\w.]*:[A-Za-z_][\w.]*')


def _expert(context: PolicyContext, seed: int | None) -> Policy:
    del seed  # Unused.
    if context.task_name not in EXPERTS:
        raise ValueError(
            f'There is no expert for the task {context.task_name!r}, only for '
            f'{", ".join(EXPERTS)}; valid for every task are random, zero.'
        )
    context.check_default_action_mode('expert')
    return EXPERTS[context.task_name]()


_POLICIES: dict[str, Callable[[PolicyContext, int | None], Policy]] = {
    'expert': _expert,
    'random': lambda context, seed: UniformPolicy(context.action_spec, seed),
    'zero': lambda context, seed: ZeroPolicy(context.action_spec),
}
_TRAINED = 'trained'
ALL = (*_POLICIES, _TRAINED)


def load(name: str, env: Any, seed: int | None = None, trust_pickle: bool = False) -> Policy:
    """Returns a policy.

    Args:
        name: One of `ALL`, of which 'trained' needs onnxruntime; or a file, PATH.onnx or PATH.zip
            (of Stable-Baselines3); or code, `module:function` (see `files.code_policy`).
        env: The environment that it will act in, as `fetch_composer.load` returns it, or its
            `PolicyContext`.
        seed: A non-negative integer for a policy that draws, or None. It may be the
            environment's own seed: their draws are independent.
        trust_pickle: Whether code within a zip file may run.

    Raises:
        ValueError: if there is no such policy, none for this task, or one that does not fit it;
            the message lists what is valid.
    """
    context = env if isinstance(env, PolicyContext) else PolicyContext.of(env)
    return factory(name, context, trust_pickle)(seed)


def factory(name: str, context: PolicyContext, trust_pickle: bool = False) -> PolicyFactory:
    """Returns what makes a policy for each seed, and reads its file once.

    Args:
        name: As for `load`.
        context: What is known of the environment.
        trust_pickle: As for `load`.

    Raises:
        ValueError: as `load` does.
    """
    if name in _POLICIES:
        _POLICIES[name](context, None)
        return lambda seed: _POLICIES[name](context, seed)
    if name == _TRAINED:
        context.check_default_action_mode(_TRAINED)
        return onnx_policy.factory(trained.path(context), context)
    if name.endswith('.onnx'):
        return onnx_policy.factory(name, context)
    if name.endswith('.zip'):
        return sb3_policy.factory(name, context, trust_pickle)
    if _CODE.fullmatch(name):
        return code_policy.factory(name, context)
    raise ValueError(
        f'Unknown policy {name!r}; valid are {", ".join(ALL)}, PATH.onnx, PATH.zip of '
        'Stable-Baselines3, and module:function.'
    )


def digest(name: str) -> str | None:
    """Returns a digest of the files that a policy comes from; None for one of `ALL`.

    Code has to be loaded first; for what counts then, see `user_modules.digest`.

    Raises:
        ValueError: if it cannot be told which files they are.
    """
    if name in ALL:
        return None
    if name.endswith('.onnx'):
        return onnx_policy.digest(name)
    if name.endswith('.zip'):
        return hashlib.sha256(pathlib.Path(name).read_bytes()).hexdigest()
    return code_policy.digest(name)
