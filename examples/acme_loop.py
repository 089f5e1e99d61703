"""Runs an Acme actor on Push in `acme.EnvironmentLoop`.

    pip install -e '.[acme]'
    python examples/acme_loop.py --episodes 5

`--wrap` adds Acme's wrappers; docs/clients.md says which release of Acme has them working.
"""

import acme
import numpy as np
from absl import app, flags
from acme import specs
from acme.utils import loggers

from fetch_composer import suite

_TASK = flags.DEFINE_enum('task', 'push', list(suite.SUITE), 'Task of the fetch domain.')
_EPISODES = flags.DEFINE_integer('episodes', 5, 'How many episodes to run.', lower_bound=1)
_SEED = flags.DEFINE_integer('seed', 0, 'Seed of task and actor.')
_WRAP = flags.DEFINE_bool('wrap', False, 'Single precision and one concatenated observation.')


class RandomActor(acme.Actor):
    """Draws uniformly from the space of actions, and learns nothing."""

    def __init__(self, spec: specs.EnvironmentSpec, seed: int) -> None:
        self._spec, self._random = spec.actions, np.random.default_rng(seed)

    def select_action(self, observation) -> np.ndarray:
        del observation  # Unused.
        action = self._random.uniform(self._spec.minimum, self._spec.maximum, self._spec.shape)
        return action.astype(self._spec.dtype)

    def observe_first(self, timestep) -> None:
        """An agent would start an episode in its replay buffer here."""

    def observe(self, action, next_timestep) -> None:
        """An agent would add a transition to its replay buffer here."""

    def update(self, wait: bool = False) -> None:
        """An agent would fetch its learner's newest variables here."""


def main(unused_argv) -> None:
    env = suite.load(suite.DOMAIN, _TASK.value, {'random': _SEED.value})
    if _WRAP.value:
        from acme import wrappers

        env = wrappers.wrap_all(
            env, [wrappers.SinglePrecisionWrapper, wrappers.ConcatObservationWrapper]
        )
    spec = acme.make_environment_spec(env)
    print(spec)
    # Without a logger of one's own, Acme writes to ~/acme.
    logger = loggers.TerminalLogger('environment_loop')
    loop = acme.EnvironmentLoop(env, RandomActor(spec, _SEED.value), logger=logger)
    loop.run(num_episodes=_EPISODES.value)


if __name__ == '__main__':
    app.run(main)
