"""The states in which Gymnasium-Robotics has settled once it has built its environments."""

import dataclasses
import functools
import importlib.resources
import json

import numpy as np


@dataclasses.dataclass(frozen=True)
class SettledState:
    """State of one environment of Gymnasium-Robotics before anything is sampled.

    Attributes:
        grip_position: (3,) position in m of the grip site, around which it samples.
        qpos: {joint: position} of base, torso, head, arm and fingers, in m or rad.
        qvel: {joint: velocity} of the same, in m/s or rad/s.
        object_height: Height of the object's centre in m, or None without an object.
        object_qpos: (7,) pose of the object: position in m and quaternion.
        object_qvel: (6,) velocity of the object in m/s and rad/s.
    """

    grip_position: np.ndarray
    qpos: dict[str, float]
    qvel: dict[str, float]
    object_height: float | None
    object_qpos: np.ndarray | None
    object_qvel: np.ndarray | None


@functools.cache
def load(name: str) -> SettledState:
    """Returns a state of settled_states.json, which says where its figures are from."""
    folder = importlib.resources.files('fetch_composer.tasks')
    figures = json.loads(folder.joinpath('settled_states.json').read_text())
    state = figures[name]

    def array_or_none(key):
        return np.array(state[key]) if key in state else None

    return SettledState(
        grip_position=np.array(state['grip_position']),
        qpos=dict(zip(figures['joints'], state['qpos'], strict=True)),
        qvel=dict(zip(figures['joints'], state['qvel'], strict=True)),
        object_height=state.get('object_height'),
        object_qpos=array_or_none('object_qpos'),
        object_qvel=array_or_none('object_qvel'),
    )
