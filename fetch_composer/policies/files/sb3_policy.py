"""Policies from the zip files that Stable-Baselines3 saves.

Such a file has Python objects in it (pickles), and whoever made it can have put code into them
that runs as they are read. It is only read when the user has said that it may.
"""

import contextlib
import json
import pathlib
import pickle
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from fetch_composer.policies.files import inputs
from fetch_composer.policies.files.network_policy import NetworkPolicy
from fetch_composer.policies.protocol import PolicyContext

# By the module of their policy class, which the file names in plain text.
_ALGORITHMS = {
    'stable_baselines3.sac': ('stable_baselines3', 'SAC'),
    'stable_baselines3.td3': ('stable_baselines3', 'TD3'),
    'stable_baselines3.common': ('stable_baselines3', 'PPO'),
    'sb3_contrib.tqc': ('sb3_contrib', 'TQC'),
}
# NAME.zip has no statistics of `VecNormalize`; they are in NAME_vecnormalize.pkl beside it.
_STATISTICS = '_vecnormalize.pkl'
_MOST_DATA = 64 * 2**20  # Bytes of the member that describes a model ...
_MOST_IN_ALL = 2 * 2**30  # ... and of all members, its networks and their optimizers included.

# Only acting is asked for: no memory is set aside for learning, and none of its settings is read.
_ROWS = 64  # At a time: a call takes about as long as for one.
_NOT_FOR_LEARNING: dict[str, Any] = {
    'replay_buffer_class': None,
    'replay_buffer_kwargs': {},
    'buffer_size': 1,
    'optimize_memory_usage': False,
    'learning_rate': 0.0,
    'lr_schedule': lambda _: 0.0,
    'clip_range': lambda _: 0.0,
}


def factory(
    path: str, context: PolicyContext, trust_pickle: bool
) -> Callable[[int | None], NetworkPolicy]:
    """Returns what makes the policy of a file, whatever the seed.

    Args:
        path: The zip file.
        context: What is known of the environment to act in.
        trust_pickle: Whether code that the file may bring with it may run.

    Raises:
        ValueError: if it may not, the file is no model, a package is not installed, or the
            model's spaces do not fit the environment; the message says which.
    """
    package, name = _algorithm(path)
    if not trust_pickle:
        raise ValueError(
            f'{path} can run code as it is read: Stable-Baselines3 files contain pickles. If you '
            'trust whoever made it, add --trust_pickle; or export it to ONNX.'
        )
    try:
        algorithms = __import__(package)
    except ModuleNotFoundError:
        raise ValueError(f"{path} needs {package}: pip install 'fetch_composer[sb3]'.") from None
    try:
        model = getattr(algorithms, name).load(path, device='cpu', custom_objects=_NOT_FOR_LEARNING)
    except Exception as error:  # Whatever its pickles, or a network of another version, raise.
        raise ValueError(
            f'{path} cannot be loaded as {name}: {type(error).__name__}: {error}'
        ) from error
    policy = of_model(model, path, context, _saved_normalizer(path))
    return lambda seed: policy


def is_model(policy: Any) -> bool:
    """Returns whether an object is a model of Stable-Baselines3, or acts as one does."""
    return all(hasattr(policy, each) for each in ('predict', 'observation_space', 'action_space'))


def of_model(
    model: Any, name: str, context: PolicyContext, normalizer: Any = None
) -> NetworkPolicy:
    """Returns the policy of a model: its deterministic actions.

    Args:
        model: A model. If `VecNormalize` is around the environment that it learns in, that
            normalises its observations here, too.
        name: What messages call it.
        context: What is known of the environment to act in.
        normalizer: A `VecNormalize` for its observations; None for the one that is around the
            environment.

    Raises:
        ValueError: if its spaces do not fit; the message says what would.
    """
    sizes = {each: spec.shape[0] for each, spec in context.observation_spec.items()}
    make = _input(model.observation_space, sizes, name)
    if tuple(model.action_space.shape) != context.action_spec.shape:
        raise ValueError(
            f'{name} gives actions of shape {tuple(model.action_space.shape)}, but this task '
            f'takes {context.action_spec.shape}.'
        )
    if normalizer is None:
        normalizer = getattr(model, 'get_vec_normalize_env', lambda: None)()

    def act(observations: Mapping[str, np.ndarray]) -> np.ndarray:
        given = make(observations)
        if normalizer is not None:
            given = normalizer.normalize_obs(given)
        with _one_thread():
            actions, _ = model.predict(given, deterministic=True)
        return actions

    return NetworkPolicy(act, _ROWS, sizes)


def _saved_normalizer(path: str) -> Any:
    """Returns the `VecNormalize` that was saved beside a model; None if none was."""
    beside = pathlib.Path(f'{path.removesuffix(".zip")}{_STATISTICS}')
    if not beside.exists():
        return None
    try:
        normalizer = pickle.loads(beside.read_bytes())
    except Exception as error:  # Whatever its pickles raise.
        raise ValueError(
            f'{beside} cannot be loaded as VecNormalize: {type(error).__name__}: {error}'
        ) from error
    if not hasattr(normalizer, 'normalize_obs'):
        raise ValueError(
            f'{beside} cannot be loaded as VecNormalize: it is a {type(normalizer).__name__}.'
        )
    return normalizer


def _algorithm(path: str) -> tuple[str, str]:
    """Returns package and name of a file's algorithm, from what is in it as plain text."""
    data = _data(path)
    try:
        module = data['policy_class']['__module__']
    except (KeyError, TypeError):
        raise ValueError(f'{path} is no model of Stable-Baselines3.') from None
    for prefix, (package, name) in _ALGORITHMS.items():
        if str(module).startswith(f'{prefix}.'):
            # A2C shares its policies with PPO, and differs from it in this.
            is_a2c = name == 'PPO' and 'clip_range' not in data
            return package, 'A2C' if is_a2c else name
    raise ValueError(f'{path} has a policy of {module}; valid are {", ".join(_ALGORITHMS)}.')


def _data(path: str) -> Any:
    """Returns what a file says of its model in plain text, once it is seen to be of fair size."""
    try:
        with zipfile.ZipFile(path) as file:
            # No more than this is inflated, whatever is there.
            in_all = sum(each.file_size for each in file.infolist())
            for size, most in (
                (file.getinfo('data').file_size, _MOST_DATA), (in_all, _MOST_IN_ALL)
            ):  # fmt: skip
                if size > most:
                    raise ValueError(
                        f'{path} would inflate to {size / 2**20:,.0f} MiB, where a model has '
                        f'{most / 2**20:,.0f} MiB at most.'
                    )
            content = file.read('data')
    except FileNotFoundError:
        raise ValueError(f'There is no file {path}.') from None
    except (OSError, EOFError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        # Damaged, encrypted, compressed in an unknown way, or without that member.
        raise ValueError(f'{path} is no model of Stable-Baselines3: {error}.') from None
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        raise ValueError(f'{path} is no model of Stable-Baselines3.') from None


def _input(space: Any, sizes: Mapping[str, int], path: str) -> Callable:
    """Returns what makes a model's observation from the environment's."""
    valid = f'as a vector {inputs.valid_layouts(sizes)}, or a dictionary of {dict(sizes)}'
    spaces = getattr(space, 'spaces', None)
    if spaces is None:
        shape = tuple(space.shape)
        parts = inputs.layout(shape[0], sizes) if len(shape) == 1 else None
        if parts is None:
            raise ValueError(
                f'{path} takes an observation of shape {shape}; of this task, valid are {valid}.'
            )
        # In double precision, which torch copies: how it rounds could depend on where an array
        # of single precision lies.
        return lambda observations: inputs.joined(observations, parts, np.float64)
    shapes = {name: (size,) for name, size in sizes.items()}
    found = {name: tuple(each.shape) for name, each in spaces.items()}
    if not found or not found.items() <= shapes.items():
        raise ValueError(f'{path} takes the observations {found}; of this task, valid are {valid}.')
    return lambda observations: {name: observations[name] for name in found}


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Lets torch use one thread: others cost more than they bring, and share work as they come."""
    torch = sys.modules.get('torch')
    if torch is None:  # Of a model that only acts as one of theirs does.
        yield
        return
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
