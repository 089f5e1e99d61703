"""Teaches SAC of Acme a task with a dense reward.

    python examples/acme_agent.py --task reach --steps 8000

docs/clients.md says what to install.
"""

import numpy as np
from absl import app, flags
from acme import specs, wrappers
from acme.agents.jax import normalization, sac
from acme.jax import experiments
from acme.utils import loggers, observers
from acme.utils.loggers import base

from fetch_composer import suite

_TASK = flags.DEFINE_enum('task', 'reach', list(suite.SUITE), 'Task of the fetch domain.')
_STEPS = flags.DEFINE_integer('steps', 8000, 'Control steps to learn from.', lower_bound=1)
_EVALUATION_EPISODES = flags.DEFINE_integer('evaluation_episodes', 50, 'At the end.', lower_bound=1)
_SEED = flags.DEFINE_integer('seed', 0, 'Seed of the agent; the tasks have others.')


class Success(observers.EnvLoopObserver):
    """Adds to the log of each episode whether it was at the goal when it ended."""

    def observe_first(self, env, timestep) -> None:
        """The start says nothing."""

    def observe(self, env, timestep, action) -> None:
        self._at_goal = env.task.is_success()

    def get_metrics(self) -> dict[str, float]:
        return {'success': float(self._at_goal)}


class Evaluation(base.Logger):
    """Prints the success of every evaluation."""

    def __init__(self) -> None:
        self._successes: list[float] = []

    def write(self, data) -> None:
        self._successes.append(data['success'])
        if len(self._successes) == _EVALUATION_EPISODES.value:
            steps = data.get('actor_steps', 0)
            print(f'success {np.mean(self._successes):.2f} after {steps} steps')
            self._successes.clear()

    def close(self) -> None:
        """Nothing is left to print."""


def _logger(label: str, steps_key=None, task_instance: int = 0) -> base.Logger:
    return Evaluation() if label == 'evaluator' else loggers.TerminalLogger(label, time_delta=30)


def _environment(seed: int):
    env = suite.load(suite.DOMAIN, _TASK.value, {'random': seed, 'reward_type': 'dense'})
    return wrappers.wrap_all(
        env, [wrappers.SinglePrecisionWrapper, wrappers.ConcatObservationWrapper]
    )


def main(unused_argv) -> None:
    spec = specs.make_environment_spec(_environment(_SEED.value))
    config = sac.SACConfig(
        learning_rate=1e-3,
        discount=0.95,
        target_entropy=sac.target_entropy_from_env_spec(spec),
        input_normalization=normalization.NormalizationConfig(),
        min_replay_size=1000,
    )
    experiments.run_experiment(
        experiments.ExperimentConfig(
            builder=sac.SACBuilder(config),
            environment_factory=_environment,
            network_factory=lambda each: sac.make_networks(each, hidden_layer_sizes=(256, 256)),
            max_num_actor_steps=_STEPS.value,
            seed=_SEED.value,
            observers=[Success()],
            logger_factory=_logger,
            checkpointing=None,
        ),
        eval_every=_STEPS.value,
        num_eval_episodes=_EVALUATION_EPISODES.value,
    )


if __name__ == '__main__':
    app.run(main)
