"""Imitates the scripted expert (DAgger): it labels what the network itself runs into.

pip install -e '.[learn]'
python examples/imitate_expert.py --task pick_and_place

The network acts, the expert says at each step what it would have done, and that is learned (Ross
et al., 2011). This works because each expert acts on the present observation alone.
"""

import argparse
import functools
import pathlib
import time

import jax
import jax.numpy as jnp
import numpy as np
import optax

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import provenance
from fetch_composer.explorer.results import statistics
from fetch_composer.learning import export, networks, replay, rollout, settings

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--task', default='push', help='name of the task')
parser.add_argument('--convention', default='documented')
parser.add_argument('--rounds', type=int, default=60, help='of one episode in each environment')
parser.add_argument('--hidden', type=int, nargs='+', default=[128, 128], help='units of each layer')
parser.add_argument('--seed', type=int, default=0)
parser.add_argument('--output_dir', type=pathlib.Path, default='output/imitate_expert')

_NUM_ENVS, _STEPS = 64, 50
_UPDATES, _BATCH_SIZE = 400, 512  # Of a round.
_EXPERT_ROUNDS = 4  # In the first rounds the expert acts itself.


class Lessons:
    """What was seen, and what the expert would have done there."""

    def __init__(self) -> None:
        self._parts: list[tuple[np.ndarray, ...]] = []

    def add(self, observations: np.ndarray, goals: np.ndarray, labels: np.ndarray) -> None:
        """Adds (n, size) observations, (n, goal_size) goals and (n, 4) labels."""
        is_near = replay.is_near_object(observations)
        self._parts.append((observations, goals, labels, is_near))

    def __len__(self) -> int:
        return sum(len(observations) for observations, *_ in self._parts)

    def sample(self, draw: np.random.Generator) -> tuple[np.ndarray, ...]:
        """Returns what was added, with the dimensions (updates, batch size) before the last.

        Half are of moments next to an object. Few moments are, and what comes of an episode is
        decided there.
        """
        observations, goals, labels, is_near = map(np.concatenate, zip(*self._parts, strict=True))
        rows = draw.integers(len(labels), size=(_UPDATES, _BATCH_SIZE))
        near = np.flatnonzero(is_near)
        if len(near):
            rows[:, ::2] = draw.choice(near, size=rows[:, ::2].shape)
        return observations[rows], goals[rows], labels[rows]


@functools.partial(jax.jit, donate_argnums=(0, 1))
def fit(actor, optimizer, scale, rate, observations, goals, labels):
    """Makes an update for each of the leading rows; returns what `scan` does."""

    def loss(actor, observation, goal, label):
        action = networks.act(actor, scale.normalize(observation, goal))
        return jnp.abs(action - label).mean()

    def body(carry, batch):
        actor, optimizer = carry
        value, gradient = jax.value_and_grad(loss)(actor, *batch)
        step, optimizer = optax.scale_by_adam().update(gradient, optimizer)
        return (jax.tree.map(lambda x, way: x - rate * way, actor, step), optimizer), value

    return jax.lax.scan(body, (actor, optimizer), (observations, goals, labels))


def main(args: argparse.Namespace) -> None:
    start = time.monotonic()
    draw = np.random.default_rng(args.seed)
    options = {'convention': args.convention, 'max_episode_steps': _STEPS}
    batch = fetch_composer.BatchEnvironment(args.task, _NUM_ENVS, **options)
    with fetch_composer.load(args.task, convention=args.convention) as env:
        experts = [policies.load('expert', env) for _ in range(_NUM_ENVS)]
        size = env.observation_spec()['observation'].shape[0]

    def label(observation, goal):
        names = ('observation', 'desired_goal', 'achieved_goal')
        rows = zip(experts, observation, goal, networks.achieved_goal(observation), strict=True)
        return np.stack([expert(dict(zip(names, seen, strict=True))) for expert, *seen in rows])

    inputs = networks.num_features(size)
    scale_of = networks.FeatureStatistics(inputs)
    actor = networks.init(draw, (inputs, *args.hidden, networks.ACTION_SIZE), last_gain=0.01)
    optimizer = optax.scale_by_adam().init(actor)
    lessons = Lessons()
    for i in range(args.rounds):
        policy = networks.Policy(actor, scale_of.scale())
        act = label if i < _EXPERT_ROUNDS else policy.act
        seeds = draw.integers(len(settings.TRAINING_SEEDS), size=_NUM_ENVS).tolist()
        episodes = rollout.run_episodes(batch, seeds, _STEPS, act)
        seen = episodes.observations[:, :-1]
        labels = [label(seen[:, step], episodes.goals) for step in range(_STEPS)]
        if i < _EXPERT_ROUNDS:  # What the networks see keeps its scale from here on.
            scale_of.add(episodes.observations, episodes.goals)
        lessons.add(
            seen.reshape(-1, size),
            np.repeat(episodes.goals, _STEPS, axis=0),
            np.stack(labels, axis=1).reshape(-1, networks.ACTION_SIZE),
        )
        if i + 1 < _EXPERT_ROUNDS:
            continue
        rate = 1e-3 * (1 - i / args.rounds)
        (actor, optimizer), _ = fit(actor, optimizer, scale_of.scale(), rate, *lessons.sample(draw))
        if i % 10 == 9:
            print(f'round {i + 1}: success {episodes.is_success().mean():.2f}', flush=True)

    policy = networks.Policy(actor, scale_of.scale())
    minutes = (time.monotonic() - start) / 60
    successes = rollout.evaluate(batch, policy.act, settings.TUNING_SEEDS[:1000], _STEPS)
    result = statistics.success_rate(successes)
    what = {name: value for name, value in vars(args).items() if name != 'output_dir'}
    hidden = ' '.join(map(str, args.hidden))
    flags = ' '.join(f'--{name} {value}' for name, value in {**what, 'hidden': hidden}.items())
    summary = {
        'method': 'imitation (DAgger) of the scripted expert',
        'command': f'python examples/imitate_expert.py {flags}',
        'success_rate': result.value,
        'success_interval': [result.low, result.high],
        'episodes': len(successes),
        'environment_steps': len(lessons),
        'updates': (args.rounds - _EXPERT_ROUNDS + 1) * _UPDATES,
        'minutes': round(minutes, 2),
        **what,
        'versions': {**provenance.versions(), 'jax': jax.__version__},
    }
    files.prepare_folder(args.output_dir)
    export.save(args.output_dir / 'policy.onnx', policy, size)
    files.save_json(args.output_dir / 'summary.json', summary)
    print(f'success {result.value:.3f} over {len(successes)} episodes, in {minutes:.1f} min')


if __name__ == '__main__':
    main(parser.parse_args())
