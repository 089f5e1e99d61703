"""Policies from ONNX files, which hold arithmetic and no code.

A network's inputs are the environment's observations by name, in any order and any selection, or
one input that takes several of them as one vector (see `inputs`). Its output, or the one of several
that is named `action` or `actions`, is the action: (4,), (1, 4), or (n, 4) where the number of rows
is free.
"""

import hashlib
import pathlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from fetch_composer.policies.files import inputs
from fetch_composer.policies.files.network_policy import NetworkPolicy
from fetch_composer.policies.protocol import PolicyContext

_ACTION_NAMES = ('action', 'actions')
_TYPES = {'tensor(float)': np.float32, 'tensor(double)': np.float64}
_ROWS = 16  # At a time: more take longer, and a single observation is padded to them.


def factory(path: str, context: PolicyContext) -> Callable[[int | None], NetworkPolicy]:
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
    options.intra_op_num_threads = 1  # For so few rows, others would cost more than they bring.
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(path, options, providers=['CPUExecutionProvider'])
    except Exception as error:  # The runtime's exceptions have no common class.
        reason = str(error).strip().splitlines()[0]
        raise ValueError(f'{path} cannot be read as ONNX: {reason}') from None
    policy = _policy(session, path, context)
    return lambda seed: policy


def digest(path: str) -> str:
    """Returns a digest of a file and of those that it keeps its weights in.

    Raises:
        ValueError: if it cannot be told which they are; the message says why.
    """
    total = hashlib.sha256(pathlib.Path(path).read_bytes())
    for name in _weight_files(path):
        try:
            weights = (pathlib.Path(path).parent / name).read_bytes()
        except OSError as error:
            raise ValueError(f'{path} has weights in {name}: {error.strerror}.') from None
        total.update(name.encode() + b'\0' + hashlib.sha256(weights).digest())
    return total.hexdigest()


def _weight_files(path: str) -> list[str]:
    """Returns the names of a network's further files."""
    try:
        import onnx
    except ModuleNotFoundError:
        raise ValueError(
            f'{path}: which files it consists of takes onnx to tell: pip install '
            "'fetch_composer[onnx]'."
        ) from None
    try:
        model = onnx.load(path, load_external_data=False)
    except Exception as error:  # Of protobuf, which comes in several kinds.
        raise ValueError(f'{path} cannot be read as ONNX: {type(error).__name__}.') from error
    entries = (entry for each in _messages(model) for entry in getattr(each, 'external_data', ()))
    return sorted({entry.value for entry in entries if entry.key == 'location'})


def _messages(message: Any) -> Iterator[Any]:
    """Yields a message of protobuf and all that are in it."""
    yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for each in [value] if hasattr(value, 'ListFields') else value:
                yield from _messages(each)


def _policy(session: Any, path: str, context: PolicyContext) -> NetworkPolicy:
    sizes = {name: spec.shape[0] for name, spec in context.observation_spec.items()}
    feeds = _feeds(session.get_inputs(), sizes, path)
    output = _output(session.get_outputs(), context.action_spec.shape[0], path)

    def act(observations: Mapping[str, np.ndarray]) -> np.ndarray:
        feed = {name: make(observations) for name, make in feeds.items()}
        (actions,) = session.run([output.name], feed)
        return actions

    shapes = [each.shape for each in (*session.get_inputs(), output)]
    is_free = all(len(shape) == 2 and not isinstance(shape[0], int) for shape in shapes)
    return NetworkPolicy(act, _ROWS if is_free else 1, sizes)


def _feeds(given, sizes: Mapping[str, int], path: str) -> dict[str, Callable]:
    """Returns for each input of the network what makes it from observations."""
    by_name = ', '.join(f'{name} ({size})' for name, size in sizes.items())
    valid = f'by name {by_name}, or as a single input {inputs.valid_layouts(sizes)}'
    if len(given) != 1 and not {each.name for each in given} <= set(sizes):
        names = ', '.join(each.name for each in given)
        raise ValueError(f'{path} has the inputs {names}; valid are {valid}.')
    feeds = {}
    for each in given:
        if each.type not in _TYPES:
            raise ValueError(
                f'{path}: input {each.name!r} is {each.type}; valid are {", ".join(_TYPES)}.'
            )
        parts = _parts(each, sizes, is_single=len(given) == 1)
        if parts is None:
            raise ValueError(
                f'{path}: input {each.name!r} has shape {_shown(each.shape)}; for one observation '
                f'or a free number of them, valid are {valid}.'
            )
        feeds[each.name] = _feed(parts, _TYPES[each.type], len(each.shape))
    return feeds


def _parts(each, sizes: Mapping[str, int], is_single: bool) -> tuple[str, ...] | None:
    """Returns the observations that an input takes, by its name or else by its width."""
    if each.name in sizes and _fits(each.shape, sizes[each.name]):
        return (each.name,)
    width = each.shape[-1] if each.shape else None
    parts = inputs.layout(width, sizes) if isinstance(width, int) else inputs.JOINED
    if parts is None or not is_single:
        return None
    return parts if _fits(each.shape, sum(sizes[part] for part in parts)) else None


def _feed(parts: tuple[str, ...], dtype: type, dimensions: int) -> Callable:
    def make(observations: Mapping[str, np.ndarray]) -> np.ndarray:
        values = inputs.joined(observations, parts, dtype)
        # Other than two dimensions are of a network that takes one observation at a time.
        return values if dimensions == 2 else values.reshape((1,) * (dimensions - 1) + (-1,))

    return make


def _output(outputs, size: int, path: str) -> Any:
    named = [each for each in outputs if each.name in _ACTION_NAMES]
    chosen = named or list(outputs)
    if len(chosen) != 1:
        names = ', '.join(each.name for each in outputs)
        raise ValueError(
            f'{path} has the outputs {names}; one must be named {" or ".join(_ACTION_NAMES)}.'
        )
    (output,) = chosen
    if output.type not in _TYPES:
        raise ValueError(
            f'{path}: output {output.name!r} is {output.type}; valid are {", ".join(_TYPES)}.'
        )
    if output.shape and not _fits(output.shape, size):
        raise ValueError(
            f'{path}: output {output.name!r} has shape {_shown(output.shape)}, but an action is '
            f'({size},), (1, {size}), or (n, {size}) with n free.'
        )
    return output


def _fits(shape, size: int) -> bool:
    """Returns whether one vector fits a network's shape, in which a free dimension is no number."""
    *batch, last = shape or [0]
    return (last == size or not isinstance(last, int)) and all(
        each == 1 or not isinstance(each, int) for each in batch
    )


def _shown(shape) -> str:
    return f'({", ".join(str(each) for each in shape)})'
