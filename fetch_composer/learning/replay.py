"""Episodes that are kept, and transitions drawn from them whose goals are chosen in hindsight."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fetch_composer.learning import networks, symmetry
from fetch_composer.learning.settings import Settings
from fetch_composer.tasks import rewards
from fetch_composer.tasks.movement import has_moved

_LIFTED = 0.04  # m above its start, after which it counts as lifted.
_NEAR = 0.05  # m along the table from the gripper to an object that it is near to.
_MOST_DRAWS = 20  # Of a transition that is to be near an object.


class Episodes(NamedTuple):
    """Episodes of equal length.

    Attributes:
        observations: (n, steps + 1, size) float32.
        goals: (n, goal_size) float32 desired goals.
        actions: (n, steps, 4) float32.
    """

    observations: np.ndarray
    goals: np.ndarray
    actions: np.ndarray

    def is_success(self) -> np.ndarray:
        """Returns (n,) whether each ends at its goal."""
        achieved = networks.achieved_goal(self.observations[:, -1])
        return rewards.is_success(achieved, self.goals)


class Transitions(NamedTuple):
    """What updates are made from; the leading dimensions are those that were asked for.

    Attributes:
        observation: (..., size) before the action.
        action: (..., 4)
        goal: (..., goal_size) the goal that the reward is about.
        reward: (...,) the sum, discounted, of the rewards after this action and some that follow.
        next_observation: (..., size) after the last of them.
        discount: (...,) of what comes after that.
    """

    observation: np.ndarray
    action: np.ndarray
    goal: np.ndarray
    reward: np.ndarray
    next_observation: np.ndarray
    discount: np.ndarray


def is_near_object(observations: np.ndarray) -> np.ndarray:
    """Returns (...,) whether, in (..., size) observations, the gripper is next to an object.

    Heights do not count. In a task without objects it always is: what is to be moved is itself.
    """
    achieved = networks.achieved_goal(observations)
    objects = achieved.reshape(*observations.shape[:-1], -1, 3)
    apart = objects[..., :2] - observations[..., np.newaxis, :2]
    return (np.square(apart).sum(axis=-1) < _NEAR**2).any(axis=-1)


class HindsightReplay:
    """The last episodes. A transition's goal is often one that its episode achieved later on.

    However badly an episode goes, it shows how to achieve what it did achieve (Andrychowicz et
    al., "Hindsight Experience Replay", 2017; here the strategy "future").
    """

    def __init__(self, settings: Settings, steps: int, observation_size: int) -> None:
        """Initializes an empty buffer.

        Args:
            settings: How many episodes are kept, and how transitions are drawn.
            steps: Control steps of an episode.
            observation_size: Length of an observation.
        """
        capacity = settings.replay_episodes
        goal_indices = networks.achieved_goal_indices(observation_size)
        self._settings = settings
        self._steps = steps
        self._episodes = Episodes(
            np.zeros((capacity, steps + 1, observation_size), np.float32),
            np.zeros((capacity, len(goal_indices)), np.float32),
            np.zeros((capacity, steps, networks.ACTION_SIZE), np.float32),
        )
        self._moved = np.zeros(capacity, bool)
        self._lifted = np.zeros(capacity, bool)
        self._near = np.zeros((capacity, steps), bool)
        self._added = 0

    def __len__(self) -> int:
        return min(self._added, self._settings.replay_episodes)

    def add(self, episodes: Episodes) -> None:
        """Keeps episodes; the oldest make room."""
        rows = (self._added + np.arange(len(episodes.goals))) % self._settings.replay_episodes
        for kept, new in zip(self._episodes, episodes, strict=True):
            kept[rows] = new
        self._mark(rows)
        self._added += len(rows)

    def _mark(self, rows: np.ndarray | slice) -> None:
        """Notes of episodes that are kept what `sample` chooses by."""
        observations = self._episodes.observations[rows]
        achieved = networks.achieved_goal(observations)
        self._moved[rows] = has_moved(achieved)
        height = achieved[..., 2::3]
        self._lifted[rows] = (height - height[:, :1]).max(axis=(1, 2)) > _LIFTED
        self._near[rows] = is_near_object(observations[:, :-1])

    def sample(
        self, generator: np.random.Generator, shape: tuple[int, ...], is_late: bool = False
    ) -> Transitions:
        """Returns transitions.

        Args:
            generator: Draws them.
            shape: Leading dimensions of what is returned.
            is_late: Whether the second half of a run has begun.
        """
        settings, steps = self._settings, self._steps
        hindsight_share = settings.late_hindsight_share if is_late else settings.hindsight_share
        near_share = settings.near_share if is_late else 0.0
        observations, goals, actions = self._episodes
        count = int(np.prod(shape))
        episode, time = self._sample_moments(generator, count, near_share)

        later = time + 1 + generator.integers(steps - time)
        in_hindsight = generator.random(count) < hindsight_share
        achieved_later = networks.achieved_goal(observations[episode, later])
        goal = np.where(in_hindsight[:, None], achieved_later, goals[episode])

        length = np.minimum(settings.return_steps, steps - time)
        reward = np.zeros(count, np.float32)
        for k in range(settings.return_steps):
            after = np.minimum(time + k + 1, steps)
            reached = networks.achieved_goal(observations[episode, after])
            kth = settings.discount**k * rewards.compute_reward(reached, goal)
            reward += np.where(k < length, kth, 0).astype(np.float32)
        drawn = Transitions(
            observation=observations[episode, time],
            action=actions[episode, time],
            goal=goal,
            reward=reward,
            next_observation=observations[episode, time + length],
            discount=(settings.discount**length).astype(np.float32),
        )
        drawn = self._seen_elsewhere(drawn, generator)
        return Transitions(*(each.reshape(*shape, *each.shape[1:]) for each in drawn))

    def _seen_elsewhere(self, drawn: Transitions, generator: np.random.Generator) -> Transitions:
        """Returns transitions of which some are mirrored, and all are moved along the table."""
        count, size = drawn.observation.shape
        # The robot's plane of symmetry is where the gripper starts.
        mirror = symmetry.Mirror(size, self._episodes.observations[0, 0, 1])
        shift = symmetry.Shift(size)
        chosen = generator.random(count) < self._settings.mirror_share
        by = generator.uniform(-1, 1, (count, 2)).astype(np.float32) * self._settings.shift

        def place(observation: np.ndarray) -> np.ndarray:
            observation[chosen] = mirror.observation(observation[chosen])
            return shift.observation(observation, by)

        drawn.goal[chosen] = mirror.goal(drawn.goal[chosen])
        drawn.action[chosen] = mirror.action(drawn.action[chosen])
        return drawn._replace(
            observation=place(drawn.observation),
            next_observation=place(drawn.next_observation),
            goal=shift.goal(drawn.goal, by),
        )

    def _sample_moments(
        self, generator: np.random.Generator, count: int, near_share: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns (count,) rows and control steps; some are drawn until the gripper is near."""
        episode = self._sample_episodes(generator, count)
        time = generator.integers(self._steps, size=count)
        if not near_share:
            return episode, time
        again = np.flatnonzero(generator.random(count) < near_share)
        for _ in range(_MOST_DRAWS):
            again = again[~self._near[episode[again], time[again]]]
            if not len(again):
                break
            episode[again] = self._sample_episodes(generator, len(again))
            time[again] = generator.integers(self._steps, size=len(again))
        return episode, time

    def _sample_episodes(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Returns (count,) rows; some are drawn from those that moved or lifted the object."""
        size = len(self)
        episode = generator.integers(size, size=count)
        chance = generator.random(count)
        begin = 0.0
        for marked, share in (
            (self._moved, self._settings.moved_share),
            (self._lifted, self._settings.lifted_share),
        ):
            rows = np.flatnonzero(marked[:size])
            chosen = (begin <= chance) & (chance < begin + share)
            if share and len(rows):
                episode[chosen] = rows[generator.integers(len(rows), size=int(chosen.sum()))]
            begin += share
        return episode

    def state(self) -> dict[str, np.ndarray]:
        """Returns all that is kept, as arrays."""
        size = len(self)
        arrays = {name: kept[:size] for name, kept in self._episodes._asdict().items()}
        return {**arrays, 'added': np.array(self._added)}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Takes over what `state` returned."""
        self._added = int(state['added'])
        size = len(self)
        for name, kept in self._episodes._asdict().items():
            kept[:size] = state[name]
        self._mark(slice(size))
