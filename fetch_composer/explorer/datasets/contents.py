"""What a dataset holds, whatever its format: episodes, and all that leads back into them."""

import contextlib
import dataclasses
import hashlib
import json
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer import policies, tasks, user_modules
from fetch_composer.batch import BatchEnvironment
from fetch_composer.explorer.episodes import replay
from fetch_composer.explorer.episodes.batch_rollout import EpisodeOptions
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.tasks.state import Identity

_OBSERVED = ('observation', 'achieved_goal', 'desired_goal')
_ROWS = 64

RUN = 'run'  # The key in `Contents.about` of what no other run has.


def about(
    identity: Mapping[str, Any], model: Identity, seeds: Sequence[int], look: str | None
) -> dict[str, Any]:
    """Returns what is said of a dataset, fit for JSON.

    Args:
        identity: What decides on its episodes, fit for JSON.
        model: What a state must share with the environment.
        seeds: The seeds of the episodes.
        look: How pictures look, if there are any.
    """
    said = {
        **identity,
        'model': model.names['model'],
        'first_seed': seeds[0],
        'episodes': len(seeds),
        'pictures': look,
    }
    digest = hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
    return {**said, RUN: digest}


@dataclasses.dataclass(frozen=True)
class Recorded:
    """An episode of T control steps, as a dataset has it.

    Attributes:
        episode: What happened.
        policy: Name of the policy that played it.
        physics: (T + 1, n) MuJoCo's integration state.
        gripper_pose: (T + 1, 7) poses from which an action moves the gripper.
    """

    episode: Episode
    policy: str
    physics: np.ndarray
    gripper_pose: np.ndarray

    @property
    def start(self) -> np.ndarray:
        """(3,) where what is moved starts, in m."""
        return self.episode.achieved_goal[0]

    @property
    def goal(self) -> np.ndarray:
        """(3,) where it should be, in m."""
        return self.episode.desired_goal[0]

    @property
    def metadata(self) -> dict[str, Any]:
        """What is said once of the episode, beside its seed."""
        return {'policy': self.policy, 'start': self.start, 'goal': self.goal}

    @property
    def is_success(self) -> np.ndarray:
        """(T + 1,) whether each observation is at the goal."""
        return tasks.is_success(self.episode.achieved_goal, self.episode.desired_goal)

    def reward(self, reward_type: str) -> np.ndarray:
        """Returns (T + 1,) the reward of each observation; that of the start was given to none."""
        goals = (self.episode.achieved_goal, self.episode.desired_goal)
        return tasks.compute_reward(*goals, reward_type)


@dataclasses.dataclass(frozen=True)
class Contents:
    """What a dataset is made of.

    Attributes:
        options: What the episodes were run with.
        episodes: The episodes, one or more.
        about: What decides on all of them, such as versions, fit for JSON.
        owner: The folder of the run, which no other one writes into at the same time.
        pictures: Yields a picture, (height, width, 3) uint8, for each observation of an episode;
            None where no format needs them.
        on_progress: Called with numbers of control steps as they are written; what it raises
            leaves no dataset.
    """

    options: EpisodeOptions
    episodes: Sequence[Episode]
    about: Mapping[str, Any]
    owner: pathlib.Path
    pictures: Callable[[Episode], Iterator[np.ndarray]] | None = None
    on_progress: Callable[[int], None] = lambda steps: None

    def recorded(self) -> Iterator[Recorded]:
        """Yields the episodes, which are played again for their physics.

        Raises:
            ReplayError: if one does not lead where it had led.
        """
        user_modules.load_all(self.options.imports)
        rows = min(_ROWS, len(self.episodes))
        batch = BatchEnvironment(self.options.task, rows, seed=0, **self.options.task_kwargs)
        with contextlib.closing(batch):
            for first in range(0, len(self.episodes), rows):
                episodes = self.episodes[first : first + rows]
                for each, *states in zip(episodes, *_replayed(batch, episodes), strict=True):
                    yield Recorded(each, policies.player(self.options.policy, each.seed), *states)
                    self.on_progress(each.steps)


def _replayed(
    batch: BatchEnvironment, episodes: Sequence[Episode]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Returns physics and poses of the gripper of some episodes, one to each row of a batch."""
    seeds = [each.seed for each in episodes]
    batch.seed([*seeds, *seeds[-1:] * (batch.num_envs - len(seeds))])
    observation = batch.reset().observation
    actions = np.zeros((batch.num_envs, *batch.single_action_spec().shape), np.float32)
    physics: list[list[np.ndarray]] = [[] for _ in episodes]
    poses: list[list[np.ndarray]] = [[] for _ in episodes]
    for step in range(max(each.steps for each in episodes) + 1):
        running = [row for row, each in enumerate(episodes) if step <= each.steps]
        for row, state in zip(running, batch.get_states(np.array(running)), strict=True):
            for name in _OBSERVED:
                replay.check(episodes[row], step, name, observation[name][row])
            physics[row].append(state.physics)
            poses[row].append(state.gripper_pose)
            if step < episodes[row].steps:
                actions[row] = episodes[row].action[step]
        observation = batch.step(actions).observation
    return [np.stack(each) for each in physics], [np.stack(each) for each in poses]
