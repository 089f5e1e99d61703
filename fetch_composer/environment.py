"""A Composer environment that advances a control step in one native call."""

import numpy as np
from dm_control import composer


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


class Environment(composer.Environment):
    """An environment for one goal task.

    It is set up for tasks that leave their MJCF alone between episodes and that count control
    steps themselves.
    """

    def __init__(self, task: composer.Task, random_state=None, **kwargs) -> None:
        """Initializes the environment.

        Args:
            task: The task.
            random_state: A seed, or a `RandomState`.
            **kwargs: Further arguments of `composer.Environment`.
        """
        if not isinstance(random_state, np.random.RandomState):
            random_state = SeededRandomState(random_state)
        kwargs = {
            'strip_singleton_obs_buffer_dim': True,
            'recompile_mjcf_every_episode': False,
            'legacy_step': False,
            **kwargs,
        }
        super().__init__(task, random_state=random_state, **kwargs)
