"""States of environments on a device, taken off it and put back."""

from collections.abc import Mapping, Sequence
from typing import Any

import dm_env
import mujoco
import numpy as np
import warp as wp

from fetch_composer import tasks
from fetch_composer.tasks import checks, starts
from fetch_composer.tasks.state import PHYSICS, State, get_physics
from fetch_composer.warp_batch.simulation import Simulation

GENERATOR = 'Philox4x32'

# What of MuJoCo's data is taken along; the rest of its integration state never changes.
_FIELDS = ('time', 'qpos', 'qvel', 'qacc_warmstart', 'ctrl', 'mocap_pos', 'mocap_quat')
_EPISODES = ('key', 'drawn', 'goal', 'steps_taken', 'is_over', 'given_place', 'given_goal')
_POSE = ('gripper_position', 'gripper_quaternion')


def key(seed: int | None) -> np.ndarray:
    """Returns (2,) the key of the generator that a seed gives."""
    return np.random.SeedSequence(seed).generate_state(2, np.uint32)


class States:
    """Reads and writes the states of the environments of a simulation."""

    def __init__(self, task: tasks.GoalTask, simulation: Simulation) -> None:
        """Initializes it.

        Args:
            task: The compiled task.
            simulation: Where the environments are.
        """
        self._identity, self._starts = task.identity, task.starts
        self._has_object = bool(task.scene.objects)
        self._gripper_link = task.addresses.gripper_link
        self._simulation = simulation
        physics = simulation.environment.physics
        self._model, self._scratch = physics.model.ptr, physics.data.ptr
        data, episodes = simulation.data, simulation.episodes
        self._arrays: dict[str, wp.array] = {name: getattr(data, name) for name in _FIELDS}
        self._arrays |= {name: getattr(episodes, name) for name in (*_EPISODES, *_POSE)}
        self._arrays['step_type'] = simulation.output.step_type

    def get(self, ids: np.ndarray) -> list[State]:
        """Returns the states of environments."""
        found = {name: array.numpy() for name, array in self._arrays.items()}
        return [self._state(found, i) for i in ids.tolist()]

    def _state(self, found: Mapping[str, np.ndarray], i: int) -> State:
        mujoco.mj_resetData(self._model, self._scratch)
        self._scratch.time = found['time'][i]
        for name in _FIELDS[1:]:
            getattr(self._scratch, name)[:] = found[name][i]
        given = {'goal': found['given_goal'][i]}
        if self._has_object:
            given['object_position'] = found['given_place'][i]
        return State(
            **self._identity.names,
            physics=get_physics(self._model, self._scratch),
            gripper_pose=self._gripper_pose(found, i),
            goal=found['goal'][i].astype(np.float64),
            prop_position=np.zeros(0),
            steps_taken=int(found['steps_taken'][i]),
            is_over=bool(found['is_over'][i]),
            variations={},
            given={
                name: place.astype(np.float64)
                for name, place in given.items()
                if not np.isnan(place).any()
            },
            generator={
                'bit_generator': GENERATOR,
                'key': found['key'][i].tolist(),
                'drawn': int(found['drawn'][i]),
            },
        )

    def _gripper_pose(self, found: Mapping[str, np.ndarray], i: int) -> np.ndarray:
        """Returns the pose that an action starts from, (7,); `_scratch` has the physics."""
        if self._simulation.observes_late:
            return np.concatenate([found[name][i] for name in _POSE]).astype(np.float64)
        mujoco.mj_kinematics(self._model, self._scratch)
        link = self._gripper_link
        return np.concatenate((self._scratch.xpos[link], self._scratch.xquat[link]))

    def check(self, state: State) -> None:
        """Raises `ValueError`, which says what differs, if a state does not fit."""
        self._identity.check(state)
        self._starts.check_restored(state.variations, state.given, state.has_begun)
        checks.mapping('generator of the state', state.generator)
        if state.generator.get('bit_generator') == GENERATOR:
            _check_generator(state.generator)

    def set(self, ids: np.ndarray, states: Sequence[State]) -> None:
        """Restores states; environments draw on as before where a state is not of such a batch."""
        arrays = {name: array.numpy().copy() for name, array in self._arrays.items()}
        for i, state in zip(ids.tolist(), states, strict=True):
            mujoco.mj_setState(self._model, self._scratch, state.physics, PHYSICS)
            for name in _FIELDS:
                arrays[name][i] = getattr(self._scratch, name)
            self._set_episode({name: array[i : i + 1] for name, array in arrays.items()}, state)
        poses = {name: arrays.pop(name) for name in _POSE}
        for name, values in arrays.items():
            self._arrays[name].assign(values)
        placed = np.zeros(len(arrays['is_over']), dtype=bool)
        placed[ids] = True
        self._simulation.observe_placed(placed)
        if self._simulation.observes_late:  # Else they follow from the physics.
            for name, values in poses.items():
                self._arrays[name].assign(values)

    def _set_episode(self, row: Mapping[str, np.ndarray], state: State) -> None:
        """Writes all but the physics to views of a row of each array."""
        row['goal'][0], row['is_over'][0] = state.goal, state.is_over
        row['steps_taken'][0] = state.steps_taken
        row['given_goal'][0], row['given_place'][0] = np.nan, np.nan
        given = starts.Start.of(state.given)
        if given.goal is not None:
            row['given_goal'][0] = given.goal
        if given.object_position is not None:
            row['given_place'][0] = given.object_position
        if state.generator['bit_generator'] == GENERATOR:
            row['key'][0], row['drawn'][0] = state.generator['key'], state.generator['drawn']
        row['gripper_position'][0], row['gripper_quaternion'][0] = np.split(state.gripper_pose, [3])
        running = dm_env.StepType.MID if state.steps_taken else dm_env.StepType.FIRST
        row['step_type'][0] = dm_env.StepType.LAST if state.is_over else running


def _check_generator(generator: Mapping[str, Any]) -> None:
    key, drawn = generator.get('key'), generator.get('drawn')
    words = [*key, drawn] if isinstance(key, (list, tuple)) else []
    if len(words) != 3 or not all(isinstance(each, int) and 0 <= each < 2**32 for each in words):
        raise ValueError(
            f"The state's generator is not one of {GENERATOR}: its key must be two words, and "
            'what is drawn one, of 32 bits.'
        )
