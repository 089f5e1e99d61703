"""Prints the states in which Gymnasium-Robotics has settled, as settled_states.json has them.

Run by the peer's interpreter, which has no fetch_composer:

    python robotics_settled.py > fetch_composer/tasks/settled_states.json
"""

import importlib.metadata
import json
from typing import Any

import gymnasium
import gymnasium_robotics
import mujoco
import numpy as np
from gymnasium_robotics.utils import mujoco_utils
from robotics_episodes import IntegerEnums, task_id

# Where each task has the robot's frame, in m: what its base is started with.
_ROBOT_POSITIONS = {
    'push': (0.405, 0.48, 0.0),
    'reach': (0.4049, 0.48, 0.0),
    'slide': (0.05, 0.48, 0.0),
    'pick_and_place': (0.405, 0.48, 0.0),
}
_PREFIX = 'robot0:'


def _state(task: str) -> tuple[list[str], dict]:
    env: Any = gymnasium.make(task_id(task)).unwrapped
    model, qpos, qvel = env.model, env.initial_qpos.copy(), env.initial_qvel
    joints = [model.joint(i) for i in range(model.njnt)]
    robot = [joint for joint in joints if joint.name.startswith(_PREFIX)]
    for joint, offset in zip(robot, _ROBOT_POSITIONS[task], strict=False):
        qpos[joint.qposadr] -= offset
    state = {
        'grip_position': env.initial_gripper_xpos.tolist(),
        'qpos': [float(qpos[joint.qposadr[0]]) for joint in robot],
        'qvel': [float(qvel[joint.dofadr[0]]) for joint in robot],
    }
    if env.has_object:
        free = model.joint('object0:joint')
        state['object_height'] = float(env.height_offset)
        state['object_qpos'] = qpos[free.qposadr[0] + np.arange(7)].tolist()
        state['object_qvel'] = qvel[free.dofadr[0] + np.arange(6)].tolist()
    return [joint.name.removeprefix(_PREFIX) for joint in robot], state


def _line_per_field(figures: dict, indent: str = '') -> str:
    """Returns JSON with one line for each list."""
    fields = (
        f'{indent}  "{name}": '
        + (_line_per_field(value, indent + '  ') if isinstance(value, dict) else json.dumps(value))
        for name, value in figures.items()
    )
    return '{\n' + ',\n'.join(fields) + f'\n{indent}}}'


def main() -> None:
    mujoco_utils.mujoco = IntegerEnums()
    gymnasium.register_envs(gymnasium_robotics)
    states = {}
    for task in _ROBOT_POSITIONS:
        joints, states[task] = _state(task)
    version = importlib.metadata.version('gymnasium-robotics')
    source = (
        f'Gymnasium-Robotics {version} run on MuJoCo {mujoco.__version__}: its state once its '
        'environment is built. SI units; sliders of the base relative to the robot frame.'
    )
    print(_line_per_field({'source': source, 'joints': joints, **states}))


if __name__ == '__main__':
    main()
