"""TD3: two critics learn from each other's lower estimate, and the actor from one of them.

Fujimoto et al., "Addressing Function Approximation Error in Actor-Critic Methods" (2018), without
noise on the target's actions, and with layers normalised.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
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


def init(seed: int, settings: Settings, num_features: int) -> Learner:
    """Returns a learner that has learned nothing."""
    actor_key, *critic_keys = jax.random.split(jax.random.key(seed), 1 + _NUM_CRITICS)
    actor_sizes = (num_features, *settings.hidden, networks.ACTION_SIZE)
    critic_sizes = (num_features + networks.ACTION_SIZE, *settings.hidden, 1)
    actor = networks.init(actor_key, actor_sizes, _ACTOR_GAIN)
    critics = [networks.init(key, critic_sizes, _CRITIC_GAIN) for key in critic_keys]
    return Learner(
        actor=actor,
        critics=critics,
        target_actor=jax.tree.map(jnp.copy, actor),
        target_critics=jax.tree.map(jnp.copy, critics),
        actor_optimizer=_OPTIMIZER.init(actor),
        critic_optimizer=_OPTIMIZER.init(critics),
    )


@functools.partial(jax.jit, static_argnames='settings', donate_argnums=0)
def update(
    learner: Learner,
    transitions: Transitions,
    scale: networks.Scale,
    learning_rate: float,
    settings: Settings,
) -> tuple[Learner, jax.Array]:
    """Makes many updates.

    Args:
        learner: What has been learned so far; it is used up.
        transitions: Of leading dimensions (n, actor_delay, batch_size): n times, the critics are
            updated actor_delay times and the actor once.
        scale: How features are normalised.
        learning_rate: Step size of Adam.
        settings: Settings of the run.

    Returns:
        What has been learned, and the mean loss of the critics.
    """
    critic_step = functools.partial(_update_critics, scale, learning_rate, settings)

    def body(learner: Learner, batches: Transitions) -> tuple[Learner, jax.Array]:
        learner, losses = jax.lax.scan(critic_step, learner, batches, unroll=True)
        last = jax.tree.map(lambda each: each[-1], batches)
        return _update_actor(scale, learning_rate, settings, learner, last), losses.mean()

    learner, losses = jax.lax.scan(body, learner, transitions)
    return learner, losses.mean()


def _update_critics(
    scale: networks.Scale,
    learning_rate: float,
    settings: Settings,
    learner: Learner,
    batch: Transitions,
) -> tuple[Learner, jax.Array]:
    x = scale.normalize(batch.observation, batch.goal)
    next_x = scale.normalize(batch.next_observation, batch.goal)
    next_action = networks.act(learner.target_actor, next_x)
    next_values = [networks.value(each, next_x, next_action) for each in learner.target_critics]
    expected = functools.reduce(jnp.minimum, next_values)
    # With rewards of -1 and 0 no return lies outside.
    target = jnp.clip(batch.reward + batch.discount * expected, -1 / (1 - settings.discount), 0)

    def loss(critics: list[networks.Network]) -> jax.Array:
        errors = [networks.value(each, x, batch.action) - target for each in critics]
        return jnp.square(jnp.stack(errors)).mean(axis=-1).sum()

    value, gradient = jax.value_and_grad(loss)(learner.critics)
    step, optimizer = _OPTIMIZER.update(gradient, learner.critic_optimizer)
    critics = _descend(learner.critics, step, learning_rate)
    learner = learner._replace(
        critics=critics,
        critic_optimizer=optimizer,
        target_critics=_follow(learner.target_critics, critics, settings),
    )
    return learner, value


def _update_actor(
    scale: networks.Scale,
    learning_rate: float,
    settings: Settings,
    learner: Learner,
    batch: Transitions,
) -> Learner:
    x = scale.normalize(batch.observation, batch.goal)

    def loss(actor: networks.Network) -> jax.Array:
        action = networks.act(actor, x)
        cost = settings.action_cost * jnp.square(action).mean()
        return cost - networks.value(learner.critics[0], x, action).mean()

    gradient = jax.grad(loss)(learner.actor)
    step, optimizer = _OPTIMIZER.update(gradient, learner.actor_optimizer)
    actor = _descend(learner.actor, step, learning_rate)
    return learner._replace(
        actor=actor,
        actor_optimizer=optimizer,
        target_actor=_follow(learner.target_actor, actor, settings),
    )


def _descend(parameters, step, learning_rate: float):
    return jax.tree.map(lambda each, way: each - learning_rate * way, parameters, step)


def _follow(targets, parameters, settings: Settings):
    rate = settings.target_rate
    return jax.tree.map(lambda old, new: old + rate * (new - old), targets, parameters)
