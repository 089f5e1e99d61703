"""Runs a policy in one of Gymnasium-Robotics' own v4 tasks, on a current MuJoCo.

Run by the peer's interpreter, which has no fetch_composer:

    python robotics_policy.py TASK POLICY.onnx FIRST_SEED LAST_SEED

Prints a JSON list: for each seed whether its episode ends at the goal.
"""

import json
import sys

import gymnasium
import gymnasium_robotics
import numpy as np
import onnxruntime
from gymnasium_robotics.utils import mujoco_utils
from robotics_episodes import IntegerEnums, task_id


def _ends_at_goal(env, session: onnxruntime.InferenceSession, seed: int) -> bool:
    names = [each.name for each in session.get_inputs()]
    observation, info = env.reset(seed=seed)
    is_over = False
    while not is_over:
        rows = {name: observation[name][None].astype(np.float32) for name in names}
        (action,) = session.run(None, rows)
        observation, _, terminated, truncated, info = env.step(action[0])
        is_over = terminated or truncated
    return bool(info['is_success'])


def main() -> None:
    task, policy, first_seed, last_seed = sys.argv[1:]
    mujoco_utils.mujoco = IntegerEnums()
    gymnasium.register_envs(gymnasium_robotics)
    env = gymnasium.make(task_id(task))
    session = onnxruntime.InferenceSession(policy, providers=['CPUExecutionProvider'])
    seeds = range(int(first_seed), int(last_seed) + 1)
    print(json.dumps([_ends_at_goal(env, session, seed) for seed in seeds]))


if __name__ == '__main__':
    main()
