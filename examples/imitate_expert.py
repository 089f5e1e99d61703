"""Imitates the scripted expert (DAgger): it labels what the network itself runs into.

pip install -e '.[learn]'
python examples/imitate_expert.py --task pick_and_place

A network that is only shown what the expert does is lost once it errs. Here it acts, the expert
says at each step what it would have done, and the network learns that (Ross et al., "A Reduction
of Imitation Learning and Structured Prediction to No-Regret Online Learning", 2011). It cannot
imitate the expert of Slide, which follows a plan that one observation does not tell.
"""

import argparse
import functools
import os
import pathlib
import time

os.environ.setdefault('XLA_FLAGS', '--xla_cpu_multi_thread_eigen=false')
os.environ.setdefault('MUJOCO_GL', 'disabled')

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import optax  # noqa: E402

import fetch_composer  # noqa: E402
from fetch_composer import policies  # noqa: E402
from fetch_composer.explorer.results import statistics  # noqa: E402
from fetch_composer.learning import export, networks, rollout, settings  # noqa: E402

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--task', default='push', help='push, pick_and_place or reach')
parser.add_argument('--convention', default='documented')
parser.add_argument('--rounds', type=int, default=60, help='of one episode in each environment')
parser.add_argument('--num_envs', type=int, default=64)
parser.add_argument('--updates', type=int, default=400, help='in a round')
parser.add_argument('--seed', type=int, default=0)
parser.add_argument('--output_dir', type=pathlib.Path, default='output/imitate_expert')

_STEPS = 50
_BATCH_SIZE = 512
_EXPERT_ROUNDS = 4  # In the first rounds the expert acts itself.


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
    batch = fetch_composer.BatchEnvironment(
        args.task, args.num_envs, convention=args.convention, max_episode_steps=_STEPS
    )
    with fetch_composer.load(args.task, convention=args.convention) as env:
        experts = [policies.load('expert', env) for _ in range(args.num_envs)]
        size = env.observation_spec()['observation'].shape[0]

    def label(observation, goal):
        names = ('observation', 'desired_goal', 'achieved_goal')
        rows = zip(experts, observation, goal, networks.achieved_goal(observation), strict=True)
        return np.stack([expert(dict(zip(names, seen, strict=True))) for expert, *seen in rows])

    scale_of = networks.FeatureStatistics(networks.num_features(size))
    sizes = (networks.num_features(size), 128, 128, networks.ACTION_SIZE)
    actor = networks.init(jax.random.key(args.seed), sizes, last_gain=0.01)
    optimizer = optax.scale_by_adam().init(actor)
    data: tuple[list, list, list] = ([], [], [])
    for i in range(args.rounds):
        policy = networks.Policy(actor, scale_of.scale())
        labels: list[np.ndarray] = []

        def act(observation, goal, policy=policy, labels=labels, i=i):
            labels.append(label(observation, goal))
            return labels[-1] if i < _EXPERT_ROUNDS else policy.act(observation, goal)

        seeds = draw.integers(len(settings.TRAINING_SEEDS), size=args.num_envs).tolist()
        episodes = rollout.run_episodes(batch, seeds, _STEPS, act)
        if i < _EXPERT_ROUNDS:  # What the networks see keeps its scale from here on.
            scale_of.add(episodes.observations, episodes.goals)
        data[0].append(episodes.observations[:, :-1].reshape(-1, size))
        data[1].append(np.repeat(episodes.goals, _STEPS, axis=0))
        data[2].append(np.stack(labels, axis=1).reshape(-1, networks.ACTION_SIZE))
        if i + 1 < _EXPERT_ROUNDS:
            continue
        rows = draw.integers(sum(map(len, data[0])), size=(args.updates, _BATCH_SIZE))
        drawn = (np.concatenate(each)[rows] for each in data)
        rate = 1e-3 * (1 - i / args.rounds)
        (actor, optimizer), losses = fit(actor, optimizer, scale_of.scale(), rate, *drawn)
        if i % 10 == 9:
            minutes, success = (time.monotonic() - start) / 60, episodes.is_success().mean()
            print(f'round {i + 1}: {minutes:.1f} min, success {success:.2f}', flush=True)

    policy = networks.Policy(actor, scale_of.scale())
    held_out = rollout.evaluate(batch, policy.act, settings.HELD_OUT_SEEDS, _STEPS)
    rate = statistics.success_rate(held_out)
    args.output_dir.mkdir(parents=True, exist_ok=True)
    export.save(args.output_dir / 'policy.onnx', policy)
    print(f'success {rate.value:.3f} ({rate.low:.3f} to {rate.high:.3f}) over {len(held_out)}')
    print(f'open {args.output_dir / "policy.onnx"}')


if __name__ == '__main__':
    main(parser.parse_args())
