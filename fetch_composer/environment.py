"""A Composer environment that advances a control step in one native call."""

import collections

import dm_env
import mujoco
import numpy as np
from absl import logging
from dm_control import composer
from dm_control.composer.observation import updater
from dm_control.rl import control
from dm_env import specs

from fetch_composer.entities.fingerprint import fingerprint
from fetch_composer.tasks import checks, seeding
from fetch_composer.tasks.goal_task import GoalTask
from fetch_composer.tasks.observables import FreshObservable
from fetch_composer.tasks.state import State

_CLOSED = 'This environment is closed; load another.'
_WARNINGS = tuple(mujoco.mjtWarning.__members__)


class Environment(composer.Environment):
    """An environment that advances a control step in one native call wherever it may.

    It may when nothing asks to be run between substeps: no substep hook of the task, of an
    entity or added from outside, and no enabled observable that is updated, delayed, buffered
    or aggregated within the control step. Otherwise it runs Composer's own loop, to the same
    trajectories and observations.

    The environment is set up for tasks that leave their MJCF alone between episodes.
    """

    _reset_next_step: bool
    _mjcf_never_compiled: bool

    def __init__(
        self,
        task: composer.Task,
        random_state=None,
        control_timestep: float | None = None,
        flat_observation: bool = False,
        **kwargs,
    ) -> None:
        """Initializes the environment.

        Args:
            task: The task.
            random_state: As for the method `seed`.
            control_timestep: Seconds between two actions; None leaves them to the task.
            flat_observation: Whether to observe one vector, `observations`, in place of a
                dictionary: its values in their order, as dm_control's suite has it.
            **kwargs: Further arguments of `composer.Environment`.

        Raises:
            ValueError: if the seed or the control timestep is not valid.
        """
        if control_timestep is not None:
            task.control_timestep = checks.positive('control_timestep', control_timestep, 'seconds')
        self._flat_observation = flat_observation
        self._is_closed = False
        kwargs = {
            'strip_singleton_obs_buffer_dim': True,
            'recompile_mjcf_every_episode': False,
            'legacy_step': False,
            **kwargs,
        }
        super().__init__(task, random_state=seeding.random_state(random_state), **kwargs)
        self._task.random = self._random_state
        self._fingerprint = fingerprint(task.root_entity.mjcf_model)

    def seed(self, seed) -> None:
        """Seeds the episodes that follow; the current one goes on.

        Args:
            seed: A non-negative integer, a `numpy.random.RandomState` to draw from, or None for
                entropy.
        """
        self._check_open()
        self._random_state = self._task.random = seeding.random_state(seed)
        self._fixed_random_state = self._random_state.get_state(legacy=False)

    def reset(self) -> dm_env.TimeStep:
        """Starts an episode.

        Raises:
            RuntimeError: if the environment is closed.
        """
        self._check_open()
        return super().reset()

    @property
    def physics(self):
        """The simulation."""
        self._check_open()
        return super().physics

    @property
    def is_over(self) -> bool:
        """Whether the next step starts another episode."""
        return self._reset_next_step

    def _check_open(self) -> None:
        if self._is_closed:
            raise RuntimeError(_CLOSED)

    def close(self) -> None:
        """Frees the simulation; closing twice does no harm."""
        if not self._is_closed:
            self._is_closed = self._reset_next_step = True
            if isinstance(self._task, GoalTask):
                self._task.close()
            super().close()

    def get_state(self) -> State:
        """Returns everything that decides on what follows, to be restored with `set_state`.

        It can be pickled, saved (`State.save`), and given to another environment of the same
        task and model, or to a row of a batch.

        Raises:
            RuntimeError: if the environment is closed or its task is not a `GoalTask`.
        """
        return self._goal_task().get_state(self._random_state, self._reset_next_step)

    def set_state(self, state: State) -> None:
        """Restores a state: what follows is, to the bit, what followed when it was taken.

        Raises:
            ValueError: if it is of another task, model or version; nothing has changed.
            RuntimeError: as for `get_state`.
        """
        task = self._goal_task()
        if self._mjcf_never_compiled:
            task.check_state(state, self._random_state)
            if self._changes_mjcf():
                self.reset()
            else:
                self._take_compiled()
                self._look_at_model()
        task.set_state(self._physics_proxy, state, self._random_state)
        self._reset_next_step = state.is_over
        self._warnings[:] = 0
        if self._observers is None:  # Buffers start anew, as after a reset.
            self._observation_updater.reset(self._physics_proxy, self._random_state)

    def _goal_task(self) -> GoalTask:
        self._check_open()
        if not isinstance(self._task, GoalTask):
            raise RuntimeError('Only environments of a GoalTask have a state to take.')
        return self._task

    def __reduce_ex__(self, protocol):
        raise TypeError(
            'An environment holds a live simulation and cannot be copied or pickled: load another '
            'one in its place, with fetch_composer.load(...) and the same seed.'
        )

    def observation_spec(self):
        """Returns the specs of an observation, by name."""
        spec = super().observation_spec()
        if not self._flat_observation:
            return spec
        size = sum(int(np.prod(each.shape)) for each in spec.values())
        dtype = np.result_type(*(each.dtype for each in spec.values()))
        name = control.FLAT_OBSERVATION_KEY
        return collections.OrderedDict({name: specs.Array((size,), dtype, name)})

    def _flattened(self, time_step: dm_env.TimeStep) -> dm_env.TimeStep:
        if not self._flat_observation:
            return time_step
        return time_step._replace(observation=control.flatten_observation(time_step.observation))

    def _reset_attempt(self) -> dm_env.TimeStep:
        self._reset_next_step = True  # Until the episode has started.
        if self._mjcf_never_compiled and not self._changes_mjcf():
            self._take_compiled()
        try:
            time_step = super()._reset_attempt()
        finally:
            if not self._mjcf_never_compiled:  # A start that is refused may be followed by a state.
                self._look_at_model()
        return self._flattened(time_step)

    def _take_compiled(self) -> None:
        """Does without the compilation that Composer repeats before the first episode.

        Observables may have been enabled since, but the model is what it was.
        """
        self._observation_updater = self._make_observation_updater()
        self._observation_updater.reset(self._physics_proxy, self._random_state)
        self._mjcf_never_compiled = False

    def _look_at_model(self) -> None:
        self._model, self._data = self._physics.model.ptr, self._physics.data.ptr
        self._observers = self._plain_observers()
        self._warnings = self._data.warning.number  # Live, and zero after a reset.
        self._no_warnings = bytes(self._warnings.nbytes)
        self._look_for_hooks()

    def _changes_mjcf(self) -> bool:
        """Returns whether the MJCF has been changed, or a hook may do so before an episode."""
        hooks = self._hooks._initialize_episode_mjcf
        own = type(self._task).initialize_episode_mjcf is composer.Task.initialize_episode_mjcf
        return bool(
            self._recompile_mjcf_every_episode
            or hooks.extra_hooks
            or hooks.entity_hooks
            or not own
            or fingerprint(self._task.root_entity.mjcf_model) != self._fingerprint
        )

    def _plain_observers(self):
        """Returns (name, function, whether its array is to be copied) of what is observed.

        None if an observable lives within the control step.
        """
        enabled = self._observation_updater._enabled_structure
        if not self._strip_singleton_obs_buffer_dim or self._observation_updater._is_nested:
            return None
        observers = []
        for name, each in enabled.items():
            plain = (
                each.update_interval == updater.DEFAULT_UPDATE_INTERVAL
                and each.delay == updater.DEFAULT_DELAY
                and each.buffer_size == updater.DEFAULT_BUFFER_SIZE
                and each.observable.aggregator is None
            )
            if not plain:
                return None
            if isinstance(each.observable, FreshObservable) and each.observable.corruptor is None:
                observers.append((name, each.observable.read, False))
            else:
                observers.append((name, each.observation_callable, True))
        return observers

    def add_extra_hook(self, hook_name, hook_callable) -> None:
        """Adds a function to be called at every episode, step or substep; see Composer."""
        super().add_extra_hook(hook_name, hook_callable)
        self._look_for_hooks()

    def _look_for_hooks(self) -> None:
        """Finds out which hooks are there, so that no step has to."""
        hooks, task = self._hooks, type(self._task)

        def is_there(*names: str) -> bool:
            found = (getattr(hooks, f'_{name}') for name in names)
            return any(each.extra_hooks or each.entity_hooks for each in found)

        self._runs_within_step = (
            is_there('before_substep', 'after_substep')
            or task.before_substep is not composer.Task.before_substep
            or task.after_substep is not composer.Task.after_substep
        )
        # Hooks that nobody else is on are the task's own methods.
        own = not is_there('before_step', 'after_step')
        self._before_step = self._task.before_step if own else hooks.before_step
        self._after_step = self._task.after_step if own else hooks.after_step

    def step(self, action) -> dm_env.TimeStep:
        """Advances one control step, or resets if the last step ended an episode.

        Args:
            action: As the action spec says; by default (4,), displacement of the gripper in units
                of 0.05 m and its opening.

        Raises:
            ValueError: if the action has another shape or is not finite; nothing has changed.
        """
        if self._reset_next_step:
            return self.reset()
        if self._observers is None or self._runs_within_step:
            return self._flattened(super().step(action))

        # The hot path: what Composer's loop does, with nothing in it that is not needed here.
        physics, task, random_state = self._physics_proxy, self._task, self._random_state
        self._before_step(physics, action, random_state)
        diverged = self._advance()
        self._after_step(physics, random_state)
        if diverged:
            reward, discount, last = 0.0, 0.0, True
        else:
            reward, discount = task.get_reward(physics), task.get_discount(physics)
            last = task.should_terminate_episode(physics) or self._data.time >= self._time_limit
        observation = collections.OrderedDict(
            [(name, np.array(read()) if copied else read())
             for name, read, copied in self._observers]
        )  # fmt: skip
        self._reset_next_step = bool(last)
        step_type = dm_env.StepType.LAST if last else dm_env.StepType.MID
        time_step = dm_env.TimeStep(step_type, reward, discount, observation)
        return self._flattened(time_step) if self._flat_observation else time_step

    def _advance(self) -> bool:
        """Advances the physics by a control step; returns whether it has diverged."""
        mujoco.mj_step(self._model, self._data, self._n_sub_steps)
        if self._warnings.tobytes() == self._no_warnings:
            return False
        kinds = [name for name, count in zip(_WARNINGS, self._warnings, strict=False) if count]
        message = f'Physics has diverged ({", ".join(kinds)}); reset the environment.'
        if self._raise_exception_on_physics_error:
            raise control.PhysicsError(message)
        logging.warning(message)
        return True
