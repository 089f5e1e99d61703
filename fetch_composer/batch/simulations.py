"""The physics of a batch: many simulations on native threads, or a single one.

Both start, advance and are observed alike; a single one does without what threads cost.
"""

import functools
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import mujoco
import mujoco.batch
import numpy as np
from dm_control import mjcf

from fetch_composer import tasks
from fetch_composer.tasks import drive, observation
from fetch_composer.tasks.starts import Start
from fetch_composer.tasks.state import State, get_physics, set_physics


def num_processors() -> int:
    """Returns how many processors this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Simulations(Protocol):
    """What a batch asks of its physics; arrays have a row for each simulation."""

    def start(self, ids: np.ndarray, starts: Sequence[Start]) -> None:
        """Puts starts in place; `ids` are in order."""

    def advance(self, actions: np.ndarray, ids: np.ndarray | None) -> np.ndarray:
        """Advances some by a control step; returns the ids of those that have diverged.

        Args:
            actions: (n, size of an action) clipped actions of those simulations.
            ids: (n,) which ones, in order; None for all.
        """

    def get(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns MuJoCo's integration state of one, and (7,) its gripper's pose."""

    def set(self, ids: np.ndarray, states: Sequence[State]) -> None:
        """Restores physics and variations of some; `ids` are in order."""

    def achieved_goal(self) -> np.ndarray:
        """Returns (n, 3 objects) positions in m, new arrays."""

    def observation(self) -> np.ndarray:
        """Returns (n, size), new arrays, as `layout` has it."""


_NONE = np.zeros(0, dtype=np.int64)


class ManySimulations:
    """Simulations that share native threads."""

    def __init__(
        self, physics: mjcf.Physics, task: tasks.GoalTask, count: int, threads: int
    ) -> None:
        """Makes the simulations.

        Args:
            physics: Of an environment of the task, which stays alive.
            task: The task, which says where episodes start and is not changed.
            count: How many simulations.
            threads: How many threads share them.
        """
        self._process = os.getpid()
        self._model = model = physics.model.ptr
        self._sims = sims = mujoco.batch.Batch(model, count, nthread=threads)
        self._starts, self._variations = task.starts, task.variations
        self._varied = self._variations.fields(sims.expand, physical_only=True)
        self._substeps = task.physics_steps_per_control_step
        self._drive = drive.Drive(sims.bind, task.addresses, task.options, task.locked_gripper)
        self._observer = observation.BatchObserver(
            model,
            sims,
            task.addresses,
            task.control_timestep,
            task.convention.object_minus_gripper,
        )
        current = self._drive.observes_current_state
        stages = mujoco.mjtStage
        self._stage = stages.mjSTAGE_POS if current else stages.mjSTAGE_NONE

    def start(self, ids: np.ndarray, starts: Sequence[Start]) -> None:
        """Puts starts in place; `ids` are in order."""
        self._check_process()
        states = [self._starts.state(start) for start in starts]
        self._vary(ids, [start.variations for start in starts])
        for i, state in zip(ids, states, strict=True):
            self._drive.place(state, i)
        self._sims.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS)

    def _check_process(self) -> None:
        if self._process != os.getpid():
            raise RuntimeError(
                'The threads of a batch do not survive a fork. Make the batch in the process that '
                "uses it, or start processes with multiprocessing's 'spawn'."
            )

    def _vary(self, ids: np.ndarray, values: Sequence[Mapping[str, np.ndarray]]) -> None:
        """Writes what was drawn, and resets the simulations."""
        if self._varied:
            for i, each in zip(ids, values, strict=True):
                self._variations.write(each, self._varied, i)
            if self._variations.need_set_const:
                self._sims.set_const(ids)
        self._sims.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)

    def get(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns MuJoCo's integration state of one, and (7,) its gripper's pose."""
        return self._sims.state[i].copy(), self._drive.gripper_pose(i)

    def set(self, ids: np.ndarray, states: Sequence[State]) -> None:
        """Restores physics and variations of some; `ids` are in order."""
        self._check_process()
        self._vary(ids, [state.variations for state in states])
        for i, state in zip(ids, states, strict=True):
            self._sims.state[i] = state.physics
        self._sims.forward(ids, stage=mujoco.mjtStage.mjSTAGE_POS)
        self._fall_behind(
            [
                i
                for i, state in zip(ids, states, strict=True)
                if self._drive.set_gripper_pose(state.gripper_pose, i)
            ]
        )

    def _fall_behind(self, ids: Sequence[int]) -> None:
        """Does for some what `drive.fall_behind` does for one."""
        if not ids:
            return
        qpos, qvel = self._sims.bind('qpos'), self._sims.bind('qvel')
        current = qpos[ids]
        for i in ids:
            behind = qpos[i].copy()
            mujoco.mj_integratePos(self._model, behind, qvel[i].copy(), -self._model.opt.timestep)
            qpos[i] = behind
        self._sims.forward(np.array(ids), stage=mujoco.mjtStage.mjSTAGE_POS)
        qpos[ids] = current

    def advance(self, actions: np.ndarray, ids: np.ndarray | None) -> np.ndarray:
        """Advances some by a control step; returns the ids of those that have diverged."""
        self._check_process()
        rows: Any = ... if ids is None else ids
        self._drive.act(actions, rows)
        if self._drive.loose_fingers:
            self._sims.step(ids, nstep=self._substeps)
            self._drive.relock(rows)
            self._sims.forward(ids, stage=self._stage)
        else:
            self._sims.step(ids, nstep=self._substeps, stage=self._stage)
        warnings = self._sims.warning[..., 1]  # How often each kind was raised.
        if not warnings.any():
            return _NONE
        diverged = np.flatnonzero(warnings.any(axis=-1))
        warnings[:] = 0
        return diverged

    def achieved_goal(self) -> np.ndarray:
        """Returns (n, 3 objects) positions in m, a new array."""
        return self._observer.achieved_goal()

    def observation(self) -> np.ndarray:
        """Returns (n, size), a new array, as `layout` has it."""
        return self._observer.observation()


class OneSimulation:
    """A single simulation: that of an environment, without the environment."""

    def __init__(self, physics: mjcf.Physics, task: tasks.GoalTask) -> None:
        """Takes an environment's simulation.

        Args:
            physics: Of an environment of the task, which is not stepped and stays alive.
            task: The task.
        """
        self._physics = physics
        self._model, self._data = physics.model.ptr, physics.data.ptr
        self._starts, self._variations = task.starts, task.variations
        self._varied = self._variations.fields(
            functools.partial(getattr, self._model), physical_only=True
        )
        self._substeps = task.physics_steps_per_control_step
        self._drive = drive.Drive(
            functools.partial(getattr, self._data),
            task.addresses,
            task.options,
            task.locked_gripper,
        )
        self._observer = observation.GoalObserver(
            self._model,
            self._data,
            task.addresses,
            task.control_timestep,
            task.convention.object_minus_gripper,
            current=self._drive.observes_current_state,
        )
        self._warnings = self._data.warning.number  # Live.
        self._no_warnings = bytes(self._warnings.nbytes)

    def start(self, ids: np.ndarray, starts: Sequence[Start]) -> None:
        """Puts a start in place, unless `ids` are empty."""
        for start in starts:
            state = self._starts.state(start)
            self._vary(start.variations)
            with self._physics.reset_context():
                self._drive.place(state)

    def _vary(self, values: Mapping[str, np.ndarray]) -> None:
        if self._varied:
            self._variations.write(values, self._varied)
            if self._variations.need_set_const:
                mujoco.mj_setConst(self._model, self._data)

    def get(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns MuJoCo's integration state, and (7,) the gripper's pose."""
        del i  # Unused.
        return get_physics(self._model, self._data), self._drive.gripper_pose()

    def set(self, ids: np.ndarray, states: Sequence[State]) -> None:
        """Restores physics and variations, unless `ids` are empty."""
        for state in states:
            self._vary(state.variations)
            self._physics.reset()
            set_physics(self._model, self._data, state.physics)
            if self._drive.set_gripper_pose(state.gripper_pose):
                drive.fall_behind(self._model, self._data)

    def advance(self, actions: np.ndarray, ids: np.ndarray | None) -> np.ndarray:
        """Advances by a control step; returns [0] if it has diverged."""
        self._drive.act(actions[0])
        mujoco.mj_step(self._model, self._data, self._substeps)
        self._drive.relock()
        if self._drive.observes_current_state:
            drive.refresh(self._model, self._data)
        if self._warnings.tobytes() == self._no_warnings:
            return _NONE
        self._warnings[:] = 0
        return np.zeros(1, dtype=np.int64)

    def achieved_goal(self) -> np.ndarray:
        """Returns (1, 3 objects) positions in m, a new array."""
        return self._observer.achieved_goal()[np.newaxis]

    def observation(self) -> np.ndarray:
        """Returns (1, size), a new array, as `layout` has it."""
        return self._observer.observation()[np.newaxis]
