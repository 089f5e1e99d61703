"""Policies to run on the Fetch tasks, by name or from a file."""

import hashlib
import pathlib
import re
from collections.abc import Callable
from typing import Any

from fetch_composer.policies import given, mixture, noisy
from fetch_composer.policies.experts import EXPERTS
from fetch_composer.policies.files import code_policy, onnx_policy, sb3_policy, trained
from fetch_composer.policies.noisy import NoisyPolicy
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
    'NoisyPolicy',
    'Policy',
    'PolicyContext',
    'PolicyFactory',
    'check_action',
    'check_shape',
    'digest',
    'factory',
    'given',
    'is_mixture',
    'load',
    'parts',
    'player',
    'with_noise',
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
            (of Stable-Baselines3); or code, `module:function` (see `files.code_policy`). Any of
            them with noise on its actions, `expert~0.2` (see `noisy`); or a mixture by episode,
            `expert:0.7,random:0.3` (see `mixture`).
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
    shares = mixture.shares(name)
    if shares:
        makers = {part: factory(part, context, trust_pickle) for part in shares}
        return lambda seed: makers[mixture.drawn(shares, seed)](seed)
    without, noise = noisy.split(name)
    if noise is not None:
        noisy.check(noise)
        if parts(without) != (without,) or noisy.split(without)[1] is not None:
            raise ValueError(
                f'{name!r}: noise is on a single policy, and once, as in expert~0.2 and '
                'expert~0.2:0.7,random:0.3.'
            )
        make = factory(without, context, trust_pickle)
        return lambda seed: NoisyPolicy(make(seed), context.action_spec, noise, seed)
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
        'Stable-Baselines3, and module:function; NAME~0.2 for one of them with noise, and '
        'NAME:0.7,NAME:0.3 for a mixture.'
    )


def is_mixture(name: str) -> bool:
    """Returns whether a name is that of a mixture.

    Raises:
        ValueError: if its shares cannot be.
    """
    return bool(mixture.shares(name))


def parts(name: str) -> tuple[str, ...]:
    """Returns the policies of a mixture by name; of any other policy, its own name."""
    return tuple(mixture.shares(name)) or (name,)


def player(name: str, seed: int) -> str:
    """Returns the policy that plays the episode of a seed: the one that a mixture draws."""
    shares = mixture.shares(name)
    return mixture.drawn(shares, seed) if shares else name


def with_noise(name: str, noise: float) -> str:
    """Returns the name of a policy with noise on its actions, or on those of a mixture.

    Raises:
        ValueError: if the noise is not a finite number from 0.
    """
    shares = mixture.shares(name)
    if not shares:
        return noisy.joined(name, noise)
    return mixture.joined({noisy.joined(part, noise): share for part, share in shares.items()})


def digest(name: str) -> str | None:
    """Returns a digest of the files that a policy comes from; None for one of `ALL`.

    Code has to be loaded first; for what counts then, see `user_modules.digest`.

    Raises:
        ValueError: if it cannot be told which files they are.
    """
    shares = mixture.shares(name)
    if shares:
        return hashlib.sha256(repr([digest(part) for part in shares]).encode()).hexdigest()
    name, _ = noisy.split(name)
    if name in ALL:
        return None
    if name.endswith('.onnx'):
        return onnx_policy.digest(name)
    if name.endswith('.zip'):
        return hashlib.sha256(pathlib.Path(name).read_bytes()).hexdigest()
    return code_policy.digest(name)
