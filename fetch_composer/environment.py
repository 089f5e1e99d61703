"""A Composer environment that advances a control step in one native call."""

import collections

import dm_env
import mujoco
import numpy as np
from absl import logging
from dm_control import composer
from dm_control.composer.observation import updater
from dm_control.rl import control

_WARNINGS = tuple(mujoco.mjtWarning.__members__)


class SeededRandomState(np.random.RandomState):
    """`RandomState` over the generator, seeded in the way, that Gymnasium uses.

    Its uniform draws are those of `gymnasium.utils.seeding.np_random(seed)`.
    """

    def __init__(self, seed=None) -> None:
        """Initializes the generator.

        Args:
            seed: A non-negative integer, or None for entropy from the operating system.
        """
        super().__init__(np.random.PCG64(np.random.SeedSequence(seed)))

    def get_state(self, legacy: bool = False):
        """Returns the state as a dict, since this generator has no legacy form."""
        del legacy  # Unused.
        return super().get_state(legacy=False)


def _random_state(seed) -> np.random.RandomState:
    return seed if isinstance(seed, np.random.RandomState) else SeededRandomState(seed)


class Environment(composer.Environment):
    """An environment that advances a control step in one native call wherever it may.

    It may when nothing asks to be run between substeps: no substep hook of the task, of an
    entity or added from outside, and no enabled observable that is updated, delayed, buffered
    or aggregated within the control step. Otherwise it runs Composer's own loop, to the same
    trajectories and observations.

    The environment is set up for tasks that leave their MJCF alone between episodes.
    """

    _reset_next_step: bool

    def __init__(self, task: composer.Task, random_state=None, **kwargs) -> None:
        """Initializes the environment.

        Args:
            task: The task.
            random_state: As for the method `seed`.
            **kwargs: Further arguments of `composer.Environment`.
        """
        kwargs = {
            'strip_singleton_obs_buffer_dim': True,
            'recompile_mjcf_every_episode': False,
            'legacy_step': False,
            **kwargs,
        }
        super().__init__(task, random_state=_random_state(random_state), **kwargs)

    def seed(self, seed) -> None:
        """Seeds the episodes that follow; the current one goes on.

        Args:
            seed: A non-negative integer, a `numpy.random.RandomState` to draw from, or None for
                entropy.
        """
        self._random_state = _random_state(seed)

    def _reset_attempt(self) -> dm_env.TimeStep:
        time_step = super()._reset_attempt()
        self._model, self._data = self._physics.model.ptr, self._physics.data.ptr
        self._observers = self._plain_observers()
        return time_step

    def _plain_observers(self):
        """Returns pairs of name and callable; None if an observable lives within the step."""
        enabled = self._observation_updater._enabled_structure
        if not self._strip_singleton_obs_buffer_dim or self._observation_updater._is_nested:
            return None
        for each in enabled.values():
            plain = (
                each.update_interval == updater.DEFAULT_UPDATE_INTERVAL
                and each.delay == updater.DEFAULT_DELAY
                and each.buffer_size == updater.DEFAULT_BUFFER_SIZE
                and each.observable.aggregator is None
            )
            if not plain:
                return None
        return [(name, each.observation_callable) for name, each in enabled.items()]

    def _runs_within_step(self) -> bool:
        """Returns whether a hook asks to be run between substeps."""
        hooks, task = self._hooks, type(self._task)
        return bool(
            hooks._before_substep.extra_hooks
            or hooks._after_substep.extra_hooks
            or hooks._before_substep.entity_hooks
            or hooks._after_substep.entity_hooks
            or task.before_substep is not composer.Task.before_substep
            or task.after_substep is not composer.Task.after_substep
        )

    def step(self, action) -> dm_env.TimeStep:
        """Advances one control step, or resets if the last step ended an episode.

        Args:
            action: (4,) displacement of the gripper in units of 0.05 m, and its opening.

        Raises:
            ValueError: if the action has another shape or is not finite; nothing has changed.
        """
        if self._reset_next_step or self._observers is None or self._runs_within_step():
            return super().step(action)

        physics, task, random_state = self._physics_proxy, self._task, self._random_state
        self._hooks.before_step(physics, action, random_state)
        diverged = self._advance()
        self._hooks.after_step(physics, random_state)
        if diverged:
            reward, discount, last = 0.0, 0.0, True
        else:
            reward, discount = task.get_reward(physics), task.get_discount(physics)
            last = task.should_terminate_episode(physics) or self._data.time >= self._time_limit
        observation = collections.OrderedDict(
            (name, np.array(observe())) for name, observe in self._observers
        )
        self._reset_next_step = bool(last)
        step_type = dm_env.StepType.LAST if last else dm_env.StepType.MID
        return dm_env.TimeStep(step_type, reward, discount, observation)

    def _advance(self) -> bool:
        """Advances the physics by a control step; returns whether it has diverged."""
        mujoco.mj_step(self._model, self._data, self._n_sub_steps)
        warnings = self._data.warning.number
        if not warnings.any():
            return False
        kinds = [name for name, count in zip(_WARNINGS, warnings, strict=False) if count]
        message = f'Physics has diverged ({", ".join(kinds)}); reset the environment.'
        if self._raise_exception_on_physics_error:
            raise control.PhysicsError(message)
        logging.warning(message)
        return True
