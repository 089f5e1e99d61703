"""TD3: two critics learn from each other's lower estimate, and the actor from one of them.

Fujimoto et al., "Addressing Function Approximation Error in Actor-Critic Methods" (2018), without
noise on the target's actions, and with layers normalised.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from fetch_composer.learning import networks
from fetch_composer.learning.replay import Transitions
from fetch_composer.learning.settings import Settings

_NUM_CRITICS = 2
_OPTIMIZER = optax.scale_by_adam()
_ACTOR_GAIN = 0.01  # Actions begin near 0.
_CRITIC_GAIN = 0.1


class Learner(NamedTuple):
    """All that updates change.

    Attributes:
        actor: The network that acts.
        critics: The networks that expect returns.
        target_actor: Follows the actor; steadier, and so it is what is evaluated and shipped.
        target_critics: Follow the critics.
        actor_optimizer: State of the actor's optimizer.
        critic_optimizer: State of the critics' optimizer.
    """

    actor: networks.Network
    critics: list[networks.Network]
    target_actor: networks.Network
    target_critics: list[networks.Network]
    actor_optimizer: optax.OptState
    critic_optimizer: optax.OptState


class Constants(NamedTuple):
    """The settings that compiled updates contain; as in `Settings`."""

    discount: float
    target_rate: float
    action_cost: float

    @classmethod
    def of(cls, settings: Settings) -> 'Constants':
        """Returns those of a run."""
        return cls(settings.discount, settings.target_rate, settings.action_cost)


def init(generator: np.random.Generator, hidden: Sequence[int], num_features: int) -> Learner:
    """Returns a learner that has learned nothing.

    Args:
        generator: Draws the weights.
        hidden: Units of each hidden layer.
        num_features: How many numbers the networks see.
    """
    actor = networks.init(generator, (num_features, *hidden, networks.ACTION_SIZE), _ACTOR_GAIN)
    critic_sizes = (num_features + networks.ACTION_SIZE, *hidden, 1)
    critics = [networks.init(generator, critic_sizes, _CRITIC_GAIN) for _ in range(_NUM_CRITICS)]
    return Learner(
        actor=actor,
        critics=critics,
        target_actor=_copied(actor),
        target_critics=_copied(critics),
        actor_optimizer=_OPTIMIZER.init(actor),
        critic_optimizer=_OPTIMIZER.init(critics),
    )


def _copied(tree):
    return jax.tree.map(lambda each: jnp.asarray(np.array(each)), tree)


@functools.partial(jax.jit, static_argnames='constants', donate_argnums=0)
def update(
    learner: Learner,
    transitions: Transitions,
    scale: networks.Scale,
    learning_rate: float,
    constants: Constants,
) -> tuple[Learner, jax.Array]:
    """Makes many updates.

    Args:
        learner: What has been learned so far; it is used up.
        transitions: Of leading dimensions (n, actor_delay, batch_size): n times, the critics are
            updated actor_delay times and the actor once.
        scale: How features are normalised.
        learning_rate: Step size of Adam.
        constants: Of the run.

    Returns:
        What has been learned, and the mean loss of the critics.
    """
    critic_step = functools.partial(_update_critics, scale, learning_rate, constants)

    def body(learner: Learner, batches: Transitions) -> tuple[Learner, jax.Array]:
        learner, losses = jax.lax.scan(critic_step, learner, batches, unroll=True)
        last = jax.tree.map(lambda each: each[-1], batches)
        return _update_actor(scale, learning_rate, constants, learner, last), losses.mean()

    learner, losses = jax.lax.scan(body, learner, transitions)
    return learner, losses.mean()


def _update_critics(
    scale: networks.Scale,
    learning_rate: float,
    constants: Constants,
    learner: Learner,
    batch: Transitions,
) -> tuple[Learner, jax.Array]:
    x = scale.normalize(batch.observation, batch.goal)
    next_x = scale.normalize(batch.next_observation, batch.goal)
    next_action = networks.act(learner.target_actor, next_x)
    next_values = [networks.value(each, next_x, next_action) for each in learner.target_critics]
    expected = functools.reduce(jnp.minimum, next_values)
    # With rewards of -1 and 0 no return lies outside.
    target = jnp.clip(batch.reward + batch.discount * expected, -1 / (1 - constants.discount), 0)

    def loss(critics: list[networks.Network]) -> jax.Array:
        errors = [networks.value(each, x, batch.action) - target for each in critics]
        return jnp.square(jnp.stack(errors)).mean(axis=-1).sum()

    value, gradient = jax.value_and_grad(loss)(learner.critics)
    step, optimizer = _OPTIMIZER.update(gradient, learner.critic_optimizer)
    critics = _descend(learner.critics, step, learning_rate)
    learner = learner._replace(
        critics=critics,
        critic_optimizer=optimizer,
        target_critics=_follow(learner.target_critics, critics, constants),
    )
    return learner, value


def _update_actor(
    scale: networks.Scale,
    learning_rate: float,
    constants: Constants,
    learner: Learner,
    batch: Transitions,
) -> Learner:
    x = scale.normalize(batch.observation, batch.goal)

    def loss(actor: networks.Network) -> jax.Array:
        action = networks.act(actor, x)
        cost = constants.action_cost * jnp.square(action).mean()
        return cost - networks.value(learner.critics[0], x, action).mean()

    gradient = jax.grad(loss)(learner.actor)
    step, optimizer = _OPTIMIZER.update(gradient, learner.actor_optimizer)
    actor = _descend(learner.actor, step, learning_rate)
    return learner._replace(
        actor=actor,
        actor_optimizer=optimizer,
        target_actor=_follow(learner.target_actor, actor, constants),
    )


def _descend(parameters, step, learning_rate: float):
    return jax.tree.map(lambda each, way: each - learning_rate * way, parameters, step)


def _follow(targets, parameters, constants: Constants):
    rate = constants.target_rate
    return jax.tree.map(lambda old, new: old + rate * (new - old), targets, parameters)
