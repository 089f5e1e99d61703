"""Records episodes of Gymnasium-Robotics' own v4 tasks on a current MuJoCo.

Run by the peer's interpreter, which has no fetch_composer:

    python robotics_episodes.py TASK KIND FIRST_SEED LAST_SEED OUTPUT.npz
"""

import sys
import types

import gymnasium
import gymnasium_robotics
import mujoco
import numpy as np
from gymnasium_robotics.utils import mujoco_utils

_STEPS = 50
_NOISE = 0.3  # Standard deviation of what is added to seeking actions.
_GRASP_DISTANCE = 0.03  # m
_NUDGED_JOINT = 'robot0:shoulder_pan_joint'
_NUDGE = 1e-15  # rad


class IntegerEnums:
    """The `mujoco` module with the enums that the peer compares read as integers.

    Since MuJoCo 3.12 an enum does not equal its number, and the peer's resets fail on that.
    """

    mjtJoint = types.SimpleNamespace(
        **{name: int(member.value) for name, member in mujoco.mjtJoint.__members__.items()}
    )
    mjtEq = types.SimpleNamespace(
        **{name: int(member.value) for name, member in mujoco.mjtEq.__members__.items()}
    )

    def __getattr__(self, name):
        return getattr(mujoco, name)


def task_id(task: str) -> str:
    """Returns the Gymnasium id of one of the peer's tasks."""
    camel_case = ''.join(word.capitalize() for word in task.split('_'))
    return f'Fetch{camel_case}-v4'


def _uniform(rng, observation, has_fingers) -> np.ndarray:
    del observation, has_fingers  # Unused.
    return rng.uniform(-1, 1, 4)


def _seeking(rng, observation, has_fingers) -> np.ndarray:
    """Returns an action that heads for the object and on through it, or for Reach's goal."""
    vector, goal = observation['observation'], observation['desired_goal']
    has_object = len(vector) > 10
    way = (vector[3:6] if has_object else goal) - vector[:3]
    fingers = 0.8
    if has_fingers:
        holding = np.linalg.norm(way) < _GRASP_DISTANCE
        fingers = -1.0 if holding else 1.0
        way = goal - vector[:3] if holding else way
    ahead = way / max(np.linalg.norm(way), 1e-9)
    return np.clip(np.append(ahead, fingers) + _NOISE * rng.standard_normal(4), -1, 1)


_KINDS = {'uniform': _uniform, 'seeking': _seeking}


def _places(observation: dict) -> tuple[np.ndarray, np.ndarray]:
    return observation['observation'][:3], observation['achieved_goal']


def _record(env, seed: int, kind: str, has_fingers: bool) -> dict[str, list]:
    """Returns the actions, places and rewards of an episode."""
    rng = np.random.default_rng(10_000 + seed)
    observation, _ = env.reset(seed=seed)
    places, actions, rewards = [_places(observation)], [], []
    for _ in range(_STEPS):
        action = _KINDS[kind](rng, observation, has_fingers).astype(np.float32)
        observation, reward, *_ = env.step(action)
        places.append(_places(observation))
        actions.append(action)
        rewards.append(reward)
    gripper, achieved_goal = map(list, zip(*places, strict=True))
    return {
        'actions': actions,
        'gripper': gripper,
        'achieved_goal': achieved_goal,
        'reward': rewards,
    }


def _repeat_nudged(env, seed: int, actions: list) -> dict[str, list]:
    """Returns the places of an episode that starts a rounding error aside."""
    observation, _ = env.reset(seed=seed)
    model, data = env.unwrapped.model, env.unwrapped.data
    data.joint(_NUDGED_JOINT).qpos += _NUDGE
    mujoco.mj_forward(model, data)
    places = [_places(observation), *(_places(env.step(action)[0]) for action in actions)]
    gripper, achieved_goal = map(list, zip(*places, strict=True))
    return {'nudged_gripper': gripper, 'nudged_achieved_goal': achieved_goal}


def main() -> None:
    task, kind, first_seed, last_seed, output = sys.argv[1:]
    mujoco_utils.mujoco = IntegerEnums()
    gymnasium.register_envs(gymnasium_robotics)
    env = gymnasium.make(task_id(task))
    seeds = range(int(first_seed), int(last_seed) + 1)
    episodes = []
    for seed in seeds:
        episode = _record(env, seed, kind, task == 'pick_and_place')
        episodes.append(episode | _repeat_nudged(env, seed, episode['actions']))
    recorded: dict[str, np.ndarray] = {
        name: np.array([episode[name] for episode in episodes]) for name in episodes[0]
    }
    np.savez(output, seed=list(seeds), **recorded)  # type: ignore[arg-type]


if __name__ == '__main__':
    main()
