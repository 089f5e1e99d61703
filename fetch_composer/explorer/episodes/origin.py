"""Recorded episodes of which others are the continuation, from one of their control steps on."""

import dataclasses
import hashlib
import pathlib
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer.tasks.state import State

_OBSERVED = ('observation', 'achieved_goal', 'desired_goal')
_IDENTITY = ('task_name', 'convention', 'action_mode', 'model', 'version')
_TOLERANCE = 1e-9  # m, rad; as of a replay.


@dataclasses.dataclass(frozen=True, eq=False)
class Origin:
    """What there was before the control step at which episodes go on.

    Attributes:
        step: The control step.
        seeds: (F,) seeds of the recorded episodes.
        arrays: (F, step or step + 1, ...) their observations, actions and rewards, by name.
        physics: (F, n) physics at the control step.
        gripper_pose: (F, 7) poses from which the next action moves the gripper.
        identity: What the environment must share with that of the states, by name.
    """

    step: int
    seeds: np.ndarray
    arrays: Mapping[str, np.ndarray]
    physics: np.ndarray
    gripper_pose: np.ndarray
    identity: Mapping[str, str]

    def check(self, env, seeds: Sequence[int]) -> None:
        """Makes sure that episodes can go on from here.

        Args:
            env: A single environment of their options; it is reset.
            seeds: Seeds of the episodes.

        Raises:
            ValueError: if a seed was not recorded, or what was recorded is of other options; the
                message says which there are, or what differs.
        """
        if not set(seeds) <= set(self.seeds.tolist()):
            raise ValueError(
                f'from_state holds the states of the seeds {", ".join(map(str, self.seeds))}, '
                f'those of filmed episodes, at step {self.step}; got '
                f'{", ".join(map(str, seeds))}. Choose with seed and episodes.'
            )
        needed = env.task.identity.names
        differing = [
            f'{name} ({self.identity[name]}, not {each})'
            for name, each in needed.items()
            if self.identity[name] != each
        ]
        for seed in seeds if not differing else ():
            env.seed(seed)
            for name, value in env.reset().observation.items():
                recorded = self.arrays[name][self._row(seed), 0]
                if not np.allclose(value, recorded, rtol=0, atol=_TOLERANCE):
                    differing.append(f'where the episode of seed {seed} starts ({name})')
        if differing:
            raise ValueError(
                f'from_state is of other options: it differs in {", ".join(differing)}. Give the '
                'options of the task with which it was made.'
            )

    def past(
        self, seeds: Sequence[int]
    ) -> Iterator[tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]]:
        """Yields actions, rewards and the observations that followed, a row for each seed."""
        rows = [self._row(seed) for seed in seeds]
        for step in range(self.step):
            yield (
                self.arrays['action'][rows, step],
                self.arrays['reward'][rows, step],
                {name: self.arrays[name][rows, step + 1] for name in _OBSERVED},
            )

    def states(self, seeds: Sequence[int], starts: Sequence[State]) -> list[State]:
        """Returns the states to go on from, given those at the starts of the episodes."""
        return [
            dataclasses.replace(
                start,
                physics=self.physics[row],
                gripper_pose=self.gripper_pose[row],
                steps_taken=self.step,
            )
            for row, start in zip(map(self._row, seeds), starts, strict=True)
        ]

    def _row(self, seed: int) -> int:
        return int(np.flatnonzero(self.seeds == seed)[0])

    def digest(self) -> str:
        """Returns a digest of what decides on the episodes that go on from here."""
        digest = hashlib.sha256()
        for array in (self.seeds, self.physics, self.gripper_pose, *self.arrays.values()):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def load(path: str | pathlib.Path, step: int) -> Origin:
    """Returns what a `trajectories.npz` has of its filmed episodes up to a control step.

    Raises:
        ValueError: if it is no such file, or holds no states of that step; the message says which
            there are.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays: dict[str, Any] = dict(file)
        seeds, filmed = arrays['seed'], arrays['filmed_seed']
        physics, gripper_pose = arrays['physics'], arrays['gripper_pose']
        identity = {name: str(arrays[name]) for name in _IDENTITY}
        rows = np.array([np.flatnonzero(seeds == seed)[0] for seed in filmed], dtype=np.int64)
        steps = arrays['steps'][rows]
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        what = 'is not there' if isinstance(error, FileNotFoundError) else 'holds no such states'
        raise ValueError(
            f'from_state must be the trajectories.npz of a run with films; {path} {what}.'
        ) from None
    chosen = steps > step
    if step < 0 or not chosen.any():
        raise ValueError(
            f'step must be from 0 to {steps.max() - 1}, before the end of a filmed episode in '
            f'{path}; got {step}.'
        )
    rows = rows[chosen]
    return Origin(
        step=step,
        seeds=filmed[chosen],
        arrays={
            **{name: arrays[name][rows, : step + 1] for name in _OBSERVED},
            **{name: arrays[name][rows, :step] for name in ('action', 'reward')},
        },
        physics=physics[chosen, step],
        gripper_pose=gripper_pose[chosen, step],
        identity=identity,
    )
