"""The networks: layers, what they see, and the policy that an actor is."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from fetch_composer.tasks import layout

# A network is a list of layers, a layer a dict of arrays.
Network = list[dict[str, jax.Array]]

ACTION_SIZE = 4
LAYER_NORM_EPSILON = 1e-5
FEATURE_LIMIT = 5.0  # Normalised features are clipped at this.
_SMALLEST_DEVIATION = 2e-3  # What hardly varies is not blown up to 1.


def achieved_goal(observation):
    """Returns the (..., 3 n) part of (..., size) observations that a goal is about.

    It is the position of each of n objects or, where there is no object, the gripper's.
    """
    indices = achieved_goal_indices(observation.shape[-1])
    start, end = indices[0], indices[-1] + 1
    if end - start == len(indices):
        return observation[..., start:end]  # Cheaper than an index for each.
    return observation[..., indices]


@functools.cache
def achieved_goal_indices(observation_size: int) -> np.ndarray:
    """Returns (3 n,) where the numbers of the achieved goal are within an observation."""
    layouts = layout.of_size(observation_size)
    places = [
        each.object_position if each.object_position.stop else each.grip_position
        for each in layouts
    ]
    return np.concatenate([np.arange(each.start, each.stop) for each in places])


def num_features(observation_size: int) -> int:
    """Returns how many numbers the networks see."""
    return observation_size + 2 * len(achieved_goal_indices(observation_size))


def features(observation: ArrayLike, goal: ArrayLike) -> jax.Array:
    """Returns (..., n) what the networks see: observation, goal, and the way that is left."""
    observation, goal = jnp.asarray(observation), jnp.asarray(goal)
    return jnp.concatenate([observation, goal, goal - achieved_goal(observation)], axis=-1)


class Scale(NamedTuple):
    """How features are normalised.

    Attributes:
        mean: (n,) mean of each.
        inverse_deviation: (n,) one over the standard deviation of each.
    """

    mean: ArrayLike
    inverse_deviation: ArrayLike

    def normalize(self, observation: ArrayLike, goal: ArrayLike) -> jax.Array:
        """Returns (..., n) normalised features."""
        centred = features(observation, goal) - self.mean
        return jnp.clip(centred * self.inverse_deviation, -FEATURE_LIMIT, FEATURE_LIMIT)


class FeatureStatistics:
    """Mean and standard deviation of the features of all episodes so far."""

    def __init__(self, size: int) -> None:
        """Initializes the statistics of `size` features."""
        self.count = 0
        self.sums = np.zeros((2, size))  # Of the features and of their squares.

    def add(self, observations: np.ndarray, goals: np.ndarray) -> None:
        """Adds (n, steps, size) observations of episodes with (n, goal_size) goals."""
        goals = np.broadcast_to(goals[:, None], (*observations.shape[:2], goals.shape[-1]))
        seen = np.asarray(features(observations, goals), np.float64)
        seen = seen.reshape(-1, seen.shape[-1])
        self.count += len(seen)
        self.sums += seen.sum(0), np.square(seen).sum(0)

    def scale(self) -> Scale:
        """Returns the scale that makes features have mean 0 and deviation 1."""
        mean, square = self.sums / max(self.count, 1)
        deviation = np.sqrt(np.maximum(square - mean**2, 0))
        inverse = 1 / np.maximum(deviation, _SMALLEST_DEVIATION)
        return Scale(mean.astype(np.float32), inverse.astype(np.float32))


def init(generator: np.random.Generator, sizes: Sequence[int], last_gain: float) -> Network:
    """Returns a new network. NumPy draws it: JAX would compile code for each of its shapes.

    Args:
        generator: Draws the weights.
        sizes: Units of each layer, from the input to the output.
        last_gain: Scale of the last layer's weights; a small one begins with outputs near 0.
    """
    network = []
    for i, (rows, columns) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        is_last = i == len(sizes) - 2
        gain = (last_gain if is_last else 1.5) / np.sqrt(rows)
        layer = {
            'weight': gain * generator.standard_normal((rows, columns)),
            'bias': np.zeros(columns),
        }
        if not is_last:
            layer |= {'norm_scale': np.ones(columns), 'norm_bias': np.zeros(columns)}
        network.append({name: jnp.asarray(np.float32(each)) for name, each in layer.items()})
    return network


def apply(network: Network, x: jax.Array) -> jax.Array:
    """Returns (..., outputs) of (..., inputs). Each hidden layer is normalised, then rectified."""
    for layer in network[:-1]:
        x = x @ layer['weight'] + layer['bias']
        x = x - x.mean(-1, keepdims=True)
        x = x * jax.lax.rsqrt(jnp.square(x).mean(-1, keepdims=True) + LAYER_NORM_EPSILON)
        x = jax.nn.relu(x * layer['norm_scale'] + layer['norm_bias'])
    return x @ network[-1]['weight'] + network[-1]['bias']


def act(actor: Network, x: jax.Array) -> jax.Array:
    """Returns (..., 4) actions in [-1, 1] for normalised features."""
    return jnp.tanh(apply(actor, x))


def value(critic: Network, x: jax.Array, action: ArrayLike) -> jax.Array:
    """Returns (...,) the discounted return that a critic expects."""
    return apply(critic, jnp.concatenate([x, jnp.asarray(action)], axis=-1))[..., 0]


@jax.jit
def _policy(actor: Network, scale: Scale, observation: ArrayLike, goal: ArrayLike) -> jax.Array:
    return act(actor, scale.normalize(observation, goal))


class Policy(NamedTuple):
    """An actor and the scale of what it sees.

    Attributes:
        actor: The network.
        scale: How its features are normalised.
    """

    actor: Network
    scale: Scale

    def act(self, observation: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Returns (n, 4) float32 actions.

        Args:
            observation: (n, size) float32 observations.
            goal: (n, goal_size) float32 desired goals.
        """
        return np.asarray(_policy(self.actor, self.scale, observation, goal))
