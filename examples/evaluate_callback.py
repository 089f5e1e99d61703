"""Says how well a policy of Stable-Baselines3 does while it is trained, and keeps the best one.

pip install -e '.[sb3]'
python examples/evaluate_callback.py --task reach --steps 10000
"""

import argparse
import pathlib

import gymnasium as gym
import torch
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback

from fetch_composer import explorer, gymnasium_ids
from fetch_composer.interfaces.sb3_vec_env import SB3VecEnv

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--task', default='reach')
parser.add_argument('--steps', type=int, default=10_000, help='environment steps to train for')
parser.add_argument('--every', type=int, default=2_000, help='environment steps per evaluation')
parser.add_argument('--output', type=pathlib.Path, default='output/best.zip')


class Evaluate(BaseCallback):
    """Evaluates the model, which acts deterministically, every so many environment steps."""

    def __init__(self, task: str, every: int, output: pathlib.Path) -> None:
        super().__init__()
        self._task, self._every, self._output = task, every, output
        self._next, self._best = every, -1.0

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._next += self._every
            success = explorer.evaluate(self.model, self._task).success_rate
            self.logger.record('eval/success_rate', success.value)
            print(
                f'{self.num_timesteps} steps: success {success.value:.2f} '
                f'({success.low:.2f} to {success.high:.2f})',
                flush=True,
            )
            if success.value > self._best:
                self._best = success.value
                self.model.save(self._output)
        return True


def main(args: argparse.Namespace) -> None:
    torch.set_num_threads(1)  # The networks are small: more threads wait for one another.
    args.output.parent.mkdir(parents=True, exist_ok=True)
    env = SB3VecEnv(gym.make_vec(gymnasium_ids.env_id(args.task), num_envs=16))
    model = SAC(
        'MultiInputPolicy',
        env,
        learning_starts=1600,
        learning_rate=1e-3,
        gamma=0.95,
        gradient_steps=8,
        replay_buffer_class=HerReplayBuffer,
        seed=0,
    )
    model.learn(args.steps, callback=Evaluate(args.task, args.every, args.output))
    print(
        'For the figure to publish, once all is chosen: python -m fetch_composer.explorer '
        f'--standard --task {args.task} --policy {args.output} --trust_pickle'
    )


if __name__ == '__main__':
    main(parser.parse_args())
