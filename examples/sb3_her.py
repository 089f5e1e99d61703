"""Trains TD3 with hindsight relabelling (Stable-Baselines3) on a native batch of environments.

pip install -e '.[sb3]'
python examples/sb3_her.py

SBX is the same algorithm with networks in JAX, which are updated faster:

pip install -e '.[sbx]'
python examples/sb3_her.py --library sbx
python examples/sb3_her.py --library sbx --env fetch_composer/FetchPush-v2 --steps 240000

What it takes: an update for every two control steps; inputs that are normalised, since all of them
are within centimetres; layers that are normalised; large noise on some of the actions; and, where
there is an object, half of every batch from episodes that moved it.
"""

import argparse
import pathlib
import time
from collections.abc import Callable

import gymnasium as gym
import numpy as np
import stable_baselines3
import torch
from matplotlib import pyplot as plt
from stable_baselines3.common import env_checker
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from fetch_composer.explorer.episodes import seeds
from fetch_composer.interfaces.sb3_replay_buffer import MovedHerReplayBuffer
from fetch_composer.interfaces.sb3_vec_env import SB3VecEnv

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--env', default='fetch_composer/FetchReach-v2', help='Gymnasium id')
parser.add_argument('--library', default='stable_baselines3', choices=['stable_baselines3', 'sbx'])
parser.add_argument('--steps', type=int, default=32_000, help='environment steps to train for')
parser.add_argument('--num_envs', type=int, default=64, help='environments in the batch')
parser.add_argument('--gradient_steps', type=int, default=32, help='per step of the batch')
parser.add_argument('--evaluations', type=int, default=10, help='points of the learning curve')
parser.add_argument('--noise', type=float, default=0.2, help='of actions while exploring')
parser.add_argument('--large_noise_share', type=float, default=0.3, help='of all actions')
parser.add_argument('--moved_share', type=float, default=0.5, help='of a batch; 0: plain hindsight')
parser.add_argument('--seed', type=int, default=0)
parser.add_argument('--output_dir', type=pathlib.Path, default='output/sb3_her')


class NormalisedReLU(torch.nn.Module):
    """Normalises what a layer gives, then rectifies it."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(torch.nn.functional.layer_norm(x, x.shape[-1:]))


def algorithm(library: str) -> tuple[type[OffPolicyAlgorithm], Callable]:
    """Returns a library's TD3, and for its networks what `NormalisedReLU` does."""
    if library == 'stable_baselines3':
        return stable_baselines3.TD3, NormalisedReLU
    import jax
    import sbx

    return sbx.TD3, lambda x: jax.nn.relu(jax.nn.standardize(x))


class Exploration(ActionNoise):
    """Normal noise, and now and then so much that the policy's own action hardly matters."""

    def __init__(self, deviation: float, large_share: float) -> None:
        super().__init__()
        self._deviation, self._large_share = deviation, large_share

    def __call__(self) -> np.ndarray:
        if np.random.random() < self._large_share:
            return np.random.uniform(-2, 2, 4)
        return np.random.normal(0, self._deviation, 4)


def success_rate(model: OffPolicyAlgorithm, env: VecNormalize) -> float:
    """Returns how often the policy succeeds in one episode of each environment, without noise."""
    env.obs_rms = model.get_vec_normalize_env().obs_rms
    env.seed(seeds.TUNING.start)
    observation, done = env.reset(), np.array([False])
    while not done.any():
        action, _ = model.predict(observation, deterministic=True)
        observation, _, done, infos = env.step(action)
    return float(np.mean([info['is_success'] for info in infos]))


def main(args: argparse.Namespace) -> None:
    torch.set_num_threads(1)  # The networks are small: more threads wait for one another.
    env_checker.check_env(gym.make(args.env).unwrapped)
    env = SB3VecEnv(gym.make_vec(args.env, num_envs=args.num_envs))
    td3, activation = algorithm(args.library)
    model = td3(
        'MultiInputPolicy',
        VecNormalize(env, norm_reward=False, clip_obs=5),
        learning_rate=1e-3,
        buffer_size=args.steps,
        learning_starts=100 * args.num_envs,  # Two episodes of random actions each.
        batch_size=256,
        gamma=0.96,
        tau=0.01,
        action_noise=Exploration(args.noise, args.large_noise_share),
        target_policy_noise=0.0,
        target_noise_clip=0.0,
        policy_kwargs={'net_arch': [128, 128], 'activation_fn': activation},
        gradient_steps=args.gradient_steps,
        replay_buffer_class=MovedHerReplayBuffer,
        replay_buffer_kwargs={'moved_share': args.moved_share},
        seed=args.seed,
    )
    test_env = SB3VecEnv(gym.make_vec(args.env, num_envs=100))
    test_env = VecNormalize(test_env, training=False, norm_reward=False, clip_obs=5)
    start, curve = time.time(), []
    for _ in range(args.evaluations):
        model.learn(args.steps // args.evaluations, reset_num_timesteps=False)
        minutes = (time.time() - start) / 60
        curve.append((model.num_timesteps, minutes, success_rate(model, test_env)))
        print('{} steps, {:.1f} min: success {:.2f}'.format(*curve[-1]), flush=True)
    args.output_dir.mkdir(parents=True, exist_ok=True)
    name = args.output_dir / args.env.split('/')[-1]
    model.save(f'{name}.zip')
    model.get_vec_normalize_env().save(f'{name}_vecnormalize.pkl')  # For the explorer, beside it.
    header = 'steps,minutes,success'
    np.savetxt(f'{name}.csv', curve, '%.7g', ',', header=header, comments='')
    steps, _, success = np.transpose(curve)
    plt.plot(steps, success, marker='.')
    plt.gca().set(xlabel='environment steps', ylabel='success', ylim=(0, 1.02), title=args.env)
    plt.savefig(f'{name}.png', dpi=120)


if __name__ == '__main__':
    main(parser.parse_args())
