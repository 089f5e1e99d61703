"""Where each environment of a batch is in its episodes: all of its state that is not physics."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import dm_env
import numpy as np

from fetch_composer import tasks
from fetch_composer.tasks import rewards, seeding, starts
from fetch_composer.tasks.state import State, copied


class BatchEpisodes:
    """The episodes of the environments of a batch; arrays have a row for each environment.

    Attributes:
        goals: (n, 3) desired goals in m; with several objects, three numbers for each.
        steps_taken: (n,) control steps since the episode started.
        step_type: (n,) types of the latest time steps.
        is_over: (n,) whether the next step starts another episode.
    """

    def __init__(self, count: int, task: tasks.GoalTask) -> None:
        """Initializes episodes that are over.

        Args:
            count: How many environments.
            task: Says where episodes start and end, and is not changed.
        """
        self._limit, self._identity = task.options.max_episode_steps, task.identity
        self._starts = task.starts
        self.goals = np.zeros((count, 3 * task.scene.num_goals))
        self.steps_taken = np.zeros(count, dtype=np.int64)
        self.step_type: np.ndarray = np.full(count, dm_env.StepType.LAST)
        self.is_over: np.ndarray = np.ones(count, dtype=bool)
        # Nothing else that is drawn can be what is refused.
        self._may_fail = bool(task.variations or task.scene.drawn_props)
        self._prop_position = [np.zeros(2 * len(task.scene.drawn_props))] * count
        self._drawn: list[Mapping[str, np.ndarray]] = [{}] * count
        # For their next episodes; only a state of a single environment brings any.
        self._given = [starts.Start()] * count

    def seed(self, seeds: Sequence[int | None]) -> None:
        """Seeds every environment anew; its current episode goes on."""
        self._random_states: list[Any] = [seeding.SeededRandomState(each) for each in seeds]

    @contextlib.contextmanager
    def starting(
        self,
        ids: np.ndarray,
        given: Sequence[starts.Start] | None = None,
        seeds: Sequence[int | None] | None = None,
    ) -> Iterator[list[starts.Start]]:
        """Gives what is drawn for new episodes, which have started once the context ends.

        If an exception ends it, nothing has been drawn or seeded, and the next step starts them.

        Args:
            ids: Indices of the environments, in order.
            given: The places that are not to be drawn; None for what states have brought.
            seeds: A seed for each environment of the batch; None where its draws go on.
        """
        self.is_over[ids] = True
        given = [self._given[i] for i in ids] if given is None else given
        sources = [self._random_states[i] for i in ids]
        if seeds is not None:
            sources = [
                source if seeds[i] is None else seeding.SeededRandomState(seeds[i])
                for i, source in zip(ids, sources, strict=True)
            ]
        generators = [source.get_state() for source in sources] if self._may_fail else []
        try:
            drawn = [
                self._starts.draw(source, each) for source, each in zip(sources, given, strict=True)
            ]
            yield drawn
        except BaseException:
            for source, generator in zip(sources, generators, strict=False):
                source.set_state(generator)
            raise
        for i, start, source in zip(ids, drawn, sources, strict=True):
            self._random_states[i] = source
            self.goals[i] = start.goal
            self._drawn[i], self._given[i] = start.variations, starts.Start()
            self._prop_position[i] = start.prop_position
        self.steps_taken[ids] = 0
        self.step_type[ids] = dm_env.StepType.FIRST
        self.is_over[ids] = False

    def advance(self, rows: Any) -> None:
        """Counts a control step of some rows; ... for all."""
        self.steps_taken[rows] += 1
        self.step_type[rows] = dm_env.StepType.MID
        if self._limit is not None:
            self.is_over = self.steps_taken >= self._limit
            self.step_type[self.is_over] = dm_env.StepType.LAST

    def end(self, rows: Any) -> None:
        """Ends the episodes of some rows, whatever their number of steps."""
        self.is_over[rows] = True
        self.step_type[rows] = dm_env.StepType.LAST

    def end_at_goal(self, achieved_goal: np.ndarray, advanced: np.ndarray) -> np.ndarray:
        """Ends the episodes that have come to their goals.

        Args:
            achieved_goal: Positions in m, of the shape of `goals`.
            advanced: (n,) which environments have just advanced; the others do not end.

        Returns:
            (n,) which ones have ended.
        """
        at_goal = advanced & rewards.is_success(achieved_goal, self.goals)
        self.end(at_goal)
        return at_goal

    def get(self, i: int, physics: np.ndarray, gripper_pose: np.ndarray) -> State:
        """Returns the state of an environment, of which the physics are known."""
        return State(
            **self._identity.names,
            physics=physics,
            gripper_pose=gripper_pose,
            goal=self.goals[i].copy(),
            prop_position=self._prop_position[i].copy(),
            steps_taken=int(self.steps_taken[i]),
            is_over=bool(self.is_over[i]),
            variations=copied(self._drawn[i]),
            given=self._given[i].given(),
            generator=self._random_states[i].get_state(),
        )

    def check(self, i: int, state: State) -> None:
        """Raises `ValueError`, which says what differs, if a state does not fit an environment."""
        self._identity.check(state)
        self._starts.check_restored(state.variations, state.given, state.has_begun)
        seeding.check_generator(self._random_states[i], state.generator)

    def set(self, i: int, state: State) -> None:
        """Restores the state of an environment, all but the physics."""
        self.goals[i] = state.goal
        self._drawn[i], self._given[i] = copied(state.variations), starts.Start.of(state.given)
        self._prop_position[i] = state.prop_position.copy()
        self.steps_taken[i] = state.steps_taken
        self.is_over[i] = state.is_over
        running = dm_env.StepType.MID if state.steps_taken else dm_env.StepType.FIRST
        self.step_type[i] = dm_env.StepType.LAST if state.is_over else running
        self._random_states[i].set_state(dict(state.generator))
