"""Policies from the zip files that Stable-Baselines3 saves.

Such a file has Python objects in it (pickles), and whoever made it can have put code into them
that runs as they are read. It is only read when the user has said that it may.
"""

import json
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fetch_composer.policies.protocol import PolicyContext

# By the module of their policy class, which the file names in plain text.
_ALGORITHMS = {
    'stable_baselines3.sac': ('stable_baselines3', 'SAC'),
    'stable_baselines3.td3': ('stable_baselines3', 'TD3'),
    'stable_baselines3.common': ('stable_baselines3', 'PPO'),
    'sb3_contrib.tqc': ('sb3_contrib', 'TQC'),
}
# Only acting is asked for: no memory is set aside for learning, and none of its settings is read.
_NOT_FOR_LEARNING: dict[str, Any] = {
    'replay_buffer_class': None,
    'replay_buffer_kwargs': {},
    'buffer_size': 1,
    'optimize_memory_usage': False,
    'learning_rate': 0.0,
    'lr_schedule': lambda _: 0.0,
    'clip_range': lambda _: 0.0,
}


class Sb3Policy:
    """Asks a trained model for each action, without exploration."""

    def __init__(self, model: Any) -> None:
        """Initializes the policy with a model of Stable-Baselines3."""
        self._model = model

    def reset(self) -> None:
        """Does nothing: each action depends on the present observation alone."""

    def __call__(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns an action, (4,) float32."""
        action, _ = self._model.predict(dict(observation), deterministic=True)
        return np.asarray(action, np.float32)


def factory(
    path: str, context: PolicyContext, trust_pickle: bool
) -> Callable[[int | None], Sb3Policy]:
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
    _check_spaces(model, path, context)
    policy = Sb3Policy(model)
    return lambda seed: policy


def _algorithm(path: str) -> tuple[str, str]:
    """Returns package and name of a file's algorithm, from what is in it as plain text."""
    try:
        with zipfile.ZipFile(path) as file:
            data = json.loads(file.read('data'))
        module = data['policy_class']['__module__']
    except FileNotFoundError:
        raise ValueError(f'There is no file {path}.') from None
    except (OSError, zipfile.BadZipFile, KeyError, TypeError, ValueError):
        raise ValueError(f'{path} is no model of Stable-Baselines3.') from None
    for prefix, (package, name) in _ALGORITHMS.items():
        if str(module).startswith(f'{prefix}.'):
            # A2C shares its policies with PPO, and differs from it in this.
            is_a2c = name == 'PPO' and 'clip_range' not in data
            return package, 'A2C' if is_a2c else name
    raise ValueError(f'{path} has a policy of {module}; valid are {", ".join(_ALGORITHMS)}.')


def _check_spaces(model: Any, path: str, context: PolicyContext) -> None:
    expected = {name: spec.shape for name, spec in context.observation_spec.items()}
    spaces = getattr(model.observation_space, 'spaces', None)
    if spaces is None:
        raise ValueError(
            f'{path} takes an observation of shape {model.observation_space.shape}, but this '
            f'task has a dictionary: {expected}.'
        )
    found = {name: tuple(space.shape) for name, space in spaces.items()}
    if found != expected:
        raise ValueError(f'{path} takes the observations {found}, but this task has {expected}.')
    if tuple(model.action_space.shape) != context.action_spec.shape:
        raise ValueError(
            f'{path} gives actions of shape {tuple(model.action_space.shape)}, but this task '
            f'takes {context.action_spec.shape}.'
        )
