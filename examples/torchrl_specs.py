"""Checks the tasks as TorchRL environments and rolls one out, from both faces.

pip install -e '.[torchrl]'
python examples/torchrl_specs.py --task push
"""

import argparse

import dm_env
import gymnasium as gym
from torchrl.envs import DMControlWrapper, GymWrapper
from torchrl.envs.utils import check_env_specs

import fetch_composer

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument('--task', default='push', choices=fetch_composer.ALL)
parser.add_argument('--steps', type=int, default=50, help='steps of the rollout')
parser.add_argument('--seed', type=int, default=0)


class DmEnvWrapper(DMControlWrapper):
    """TorchRL's wrapper of dm_control, which refuses Composer environments by their type."""

    def _check_kwargs(self, kwargs: dict) -> None:
        if not isinstance(kwargs['env'], dm_env.Environment):
            raise TypeError(f'env must be a dm_env.Environment, got {kwargs["env"]!r}.')

    def _set_seed(self, seed: int | None) -> None:
        self._env.seed(seed)  # TorchRL would look for a private attribute of the task.
        self.reset()


def make_envs(task: str) -> dict:
    """Returns the task from its dm_env face and from its Gymnasium face."""
    gym_id = f'fetch_composer/Fetch{task.title().replace("_", "")}-v2'
    return {
        'DMControlWrapper': DmEnvWrapper(fetch_composer.load(task)),
        'GymWrapper': GymWrapper(gym.make(gym_id)),
    }


def main(args: argparse.Namespace) -> None:
    for name, env in make_envs(args.task).items():
        env.set_seed(args.seed)
        check_env_specs(env)
        rollout = env.rollout(args.steps)
        reward, truncated = rollout['next', 'reward'], rollout['next', 'truncated']
        print(
            f'{name}: specs hold; {len(rollout)} random steps, return {reward.sum():.0f}, '
            f'truncated {bool(truncated[-1])}; observations '
            f'{ {key: tuple(spec.shape) for key, spec in env.observation_spec.items()} }'
        )
        env.close()


if __name__ == '__main__':
    main(parser.parse_args())
