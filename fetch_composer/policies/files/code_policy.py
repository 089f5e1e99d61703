"""Policies from the user's own code, named as `module:function`.

A function takes an observation and returns an action. A class, or a function with a parameter
`context` or `seed`, makes a policy: it is called for each episode, with those that it has. The
context is a `PolicyContext`: names and specs.
"""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fetch_composer import user_modules
from fetch_composer.policies.protocol import PolicyContext, as_action

_PARAMETERS = ('context', 'seed')


class CodePolicy:
    """Calls the user's code for each action."""

    def __init__(self, act: Callable) -> None:
        """Initializes the policy.

        Args:
            act: Takes an observation and returns an action. It may have a method `reset`, to be
                called at the start of each episode.
        """
        self._act = act

    def reset(self) -> None:
        """Resets the user's policy, if it has such a method."""
        reset = getattr(self._act, 'reset', None)
        if reset is not None:
            reset()

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns what the code returns, which should be an action, as an array."""
        return as_action(self._act(observation))


def factory(name: str, context: PolicyContext) -> Callable[[int | None], CodePolicy]:
    """Returns what makes a policy for each seed.

    Args:
        name: `module:function`; the module may lie in the working directory.
        context: Passed to code that has a parameter of that name.

    Raises:
        ValueError: if there is no such module or function; the message says which.
    """
    module_name, _, path = name.partition(':')
    found: Any = user_modules.load(module_name)
    for part in path.split('.'):
        if not hasattr(found, part):
            public = [each for each in vars(found) if not each.startswith('_')]
            raise ValueError(
                f'{name!r}: there is no {part!r} in {module_name!r}; it has {", ".join(public)}.'
            )
        found = getattr(found, part)
    return of_code(found, name, context)


def of_code(found: Any, name: str, context: PolicyContext) -> Callable[[int | None], CodePolicy]:
    """Returns what makes a policy of a function or class, for each seed.

    Raises:
        ValueError: if it cannot be called; the message has its name.
    """
    if not callable(found):
        raise ValueError(f'{name!r} cannot be called: it is a {type(found).__name__}.')
    taken = [each for each in _PARAMETERS if each in _parameters(found)]
    if not inspect.isclass(found) and not taken:
        return lambda seed: CodePolicy(found)

    def make(seed: int | None) -> CodePolicy:
        given = {'context': context, 'seed': seed}
        return CodePolicy(found(**{each: given[each] for each in taken}))

    return make


def digest(name: str) -> str | None:
    """Returns a digest of code that has been loaded; see `user_modules.digest`."""
    return user_modules.digest(name.partition(':')[0])


def _parameters(function: Callable) -> tuple[str, ...]:
    try:
        return tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):  # Some that are built in have no signature.
        return ()
