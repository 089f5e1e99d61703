"""Policies from ONNX files, which hold arithmetic and no code.

A network's inputs are the environment's observations by name, in any order and any selection, or
one input that takes `observation` followed by `desired_goal`. Its output, or the one of several
that is named `action` or `actions`, is the action: (4,) or (1, 4).
"""

import pathlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fetch_composer.policies.protocol import PolicyContext

_JOINED = ('observation', 'desired_goal')
_ACTION_NAMES = ('action', 'actions')
_TYPES = {'tensor(float)': np.float32, 'tensor(double)': np.float64}


class OnnxPolicy:
    """Asks a network for each action; keeps nothing from one step to the next."""

    def __init__(self, session: Any, path: str, context: PolicyContext) -> None:
        """Makes sure that the network fits the environment.

        Args:
            session: An `onnxruntime.InferenceSession`.
            path: The file, for messages.
            context: What is known of the environment to act in.

        Raises:
            ValueError: if the network's inputs or its output do not fit; the message says how.
        """
        self._session = session
        sizes = {name: spec.shape[0] for name, spec in context.observation_spec.items()}
        self._feeds = _feeds(session.get_inputs(), sizes, path)
        self._output = _output(session.get_outputs(), context.action_spec.shape[0], path)

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32."""
        feed = {name: make(observation) for name, make in self._feeds.items()}
        (action,) = self._session.run([self._output], feed)
        return np.asarray(action, np.float32).reshape(-1)


def factory(path: str, context: PolicyContext) -> Callable[[int | None], OnnxPolicy]:
    """Returns what makes the policy of a file, whatever the seed.

    Raises:
        ValueError: if onnxruntime is not installed, it cannot read the file, or the
            network does not fit; the message says which.
    """
    try:
        import onnxruntime
    except ModuleNotFoundError:
        raise ValueError(f"{path} needs onnxruntime: pip install 'fetch_composer[onnx]'.") from None
    if not pathlib.Path(path).is_file():
        raise ValueError(f'There is no file {path}.')
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # For a vector, others would cost more than they bring.
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(path, options, providers=['CPUExecutionProvider'])
    except Exception as error:  # The runtime's exceptions have no common class.
        reason = str(error).strip().splitlines()[0]
        raise ValueError(f'{path} cannot be read as ONNX: {reason}') from None
    policy = OnnxPolicy(session, path, context)
    return lambda seed: policy


def _feeds(inputs, sizes: Mapping[str, int], path: str) -> dict[str, Callable]:
    """Returns for each input of the network what makes it from an observation."""
    names = [each.name for each in inputs]
    parts: dict[str, tuple[str, ...]]
    valid = ', '.join(f'{name} ({size})' for name, size in sizes.items())
    if set(names) <= set(sizes):
        parts = {name: (name,) for name in names}
    elif len(names) == 1:
        parts = {names[0]: _JOINED}
    else:
        raise ValueError(f'{path} has the inputs {", ".join(names)}; valid are {valid}.')
    feeds = {}
    for each in inputs:
        needed = sum(sizes[part] for part in parts[each.name])
        if each.type not in _TYPES:
            raise ValueError(
                f'{path}: input {each.name!r} is {each.type}; valid are {", ".join(_TYPES)}.'
            )
        if not _fits(each.shape, needed):
            what = ' and '.join(parts[each.name])
            raise ValueError(
                f'{path}: input {each.name!r} has shape {_shown(each.shape)}, but {what} of this '
                f'task is ({needed},) or (1, {needed}). Valid inputs are {valid}, or a single one '
                f'for {" and ".join(_JOINED)} ({sum(sizes[part] for part in _JOINED)}).'
            )
        feeds[each.name] = _feed(parts[each.name], _TYPES[each.type], len(each.shape))
    return feeds


def _feed(parts: tuple[str, ...], dtype: type, dimensions: int) -> Callable:
    shape = (1,) * (dimensions - 1) + (-1,)
    return lambda observation: (
        np.concatenate([observation[part] for part in parts]).astype(dtype).reshape(shape)
    )


def _output(outputs, size: int, path: str) -> str:
    named = [each for each in outputs if each.name in _ACTION_NAMES]
    chosen = named or list(outputs)
    if len(chosen) != 1:
        names = ', '.join(each.name for each in outputs)
        raise ValueError(
            f'{path} has the outputs {names}; one must be named {" or ".join(_ACTION_NAMES)}.'
        )
    (output,) = chosen
    if output.shape and not _fits(output.shape, size):
        raise ValueError(
            f'{path}: output {output.name!r} has shape {_shown(output.shape)}, but an action is '
            f'({size},) or (1, {size}).'
        )
    return output.name


def _fits(shape, size: int) -> bool:
    """Returns whether one vector fits a network's shape, in which a free dimension is no number."""
    *batch, last = shape or [0]
    return (last == size or not isinstance(last, int)) and all(
        each == 1 or not isinstance(each, int) for each in batch
    )


def _shown(shape) -> str:
    return f'({", ".join(str(each) for each in shape)})'
