"""Clones the policy of a Minari dataset: the plainest learner from data, and a test of the data.

pip install -e '.[learn,minari]'
python explore.py --task push --episodes 1000 --films none --dataset fetch/push-expert-v0
python examples/behaviour_cloning.py --dataset fetch/push-expert-v0
python explore.py --task push --standard --policy output/behaviour_cloning/policy.onnx

Nothing but the dataset is learned from. The loss is the mean distance of actions, not its square:
what minimises it is the median, which Gaussian noise on actions does not move, clipped or not.
"""

import argparse
import functools
import pathlib
import time

import jax
import jax.numpy as jnp
import minari
import numpy as np
import optax

from fetch_composer import explorer
from fetch_composer.explorer import files
from fetch_composer.learning import export, networks

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--dataset', default='fetch/push-expert-v0', help='name of the dataset')
parser.add_argument('--updates', type=int, default=30_000)
parser.add_argument('--seed', type=int, default=0)
parser.add_argument('--output_dir', type=pathlib.Path, default='output/behaviour_cloning')

_BATCH_SIZE, _UPDATES_A_CALL = 512, 1000
_LEARNING_RATE = 1e-3  # At the start; it falls to 0.


def load(dataset: minari.MinariDataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns (n, T, size) observations, (n, 3) goals and (n, T, 4) actions of its episodes."""
    episodes = list(dataset.iterate_episodes())
    observations = np.stack([each.observations['observation'][:-1] for each in episodes])
    goals = np.stack([each.observations['desired_goal'][0] for each in episodes])
    return observations, goals, np.stack([each.actions for each in episodes])


def main(args: argparse.Namespace) -> None:
    start = time.monotonic()
    dataset = minari.load_dataset(args.dataset)
    task = dataset.env_spec.kwargs['task']
    convention = dataset.env_spec.kwargs['convention']
    observations, goals, actions = load(dataset)
    steps, size = observations.shape[1:]
    statistics = networks.FeatureStatistics(networks.num_features(size))
    statistics.add(observations, goals)
    scale = statistics.scale()
    rows = tuple(
        jnp.asarray(each, jnp.float32).reshape(-1, each.shape[-1])
        for each in (observations, np.repeat(goals[:, None], steps, axis=1), actions)
    )
    draw = np.random.default_rng(args.seed)
    actor = networks.init(draw, (networks.num_features(size), 256, 256, 4), last_gain=0.01)
    optimizer = optax.adam(optax.linear_schedule(_LEARNING_RATE, 0, args.updates))

    def loss(actor, batch):
        observation, goal, action = batch
        return jnp.abs(networks.act(actor, scale.normalize(observation, goal)) - action).mean()

    @functools.partial(jax.jit, donate_argnums=0)
    def fit(state, key):
        def body(state, key):
            actor, moments = state
            drawn = jax.random.randint(key, (_BATCH_SIZE,), 0, len(rows[0]))
            value, gradient = jax.value_and_grad(loss)(actor, [each[drawn] for each in rows])
            update, moments = optimizer.update(gradient, moments)
            return (optax.apply_updates(actor, update), moments), value

        return jax.lax.scan(body, state, jax.random.split(key, _UPDATES_A_CALL))

    key = jax.random.key(args.seed)
    state = (actor, optimizer.init(actor))
    for i in range(args.updates // _UPDATES_A_CALL):
        key, own = jax.random.split(key)
        state, losses = fit(state, own)
        print(f'update {(i + 1) * _UPDATES_A_CALL}: loss {losses.mean():.4f}', flush=True)

    files.prepare_folder(args.output_dir)
    path = args.output_dir / 'policy.onnx'
    export.save(path, networks.Policy(state[0], scale), size)
    minutes = (time.monotonic() - start) / 60
    result = explorer.evaluate(str(path), task, convention=convention).success_rate
    print(f'{path}: success {result.value:.3f} of 100 episodes, in {minutes:.1f} min')


if __name__ == '__main__':
    main(parser.parse_args())
