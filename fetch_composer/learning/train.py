"""A whole run: Reach for the relay, then the task, its curve, and the policy at the end."""

import dataclasses
import math
import pathlib
import time
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from fetch_composer.batch import BatchEnvironment
from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import provenance
from fetch_composer.explorer.folder_lock import FolderLock
from fetch_composer.explorer.results import statistics
from fetch_composer.learning import checkpoint, curve, networks
from fetch_composer.learning import settings as settings_lib
from fetch_composer.learning.relay import Relay, Still
from fetch_composer.learning.trainer import DivergedError, Trainer, flatten, unflatten
from fetch_composer.tasks import checks, conventions, layout

_RELAY_TASK = 'reach'


@dataclasses.dataclass(frozen=True)
class Options:
    """What to learn, and for how long.

    Attributes:
        task: Name of the task.
        convention: 'documented' or 'gymnasium_robotics'.
        seed: A non-negative integer that fixes the run.
        settings: Settings of the learner.
        minutes: After so many minutes, runs before this one included, it ends; None for never.
        output_dir: Folder to write into.
        num_threads: Threads of the simulation; None for one for each processor.
        device: A device of Warp that simulates, such as 'cuda'; None for the native batch.
    """

    task: str
    convention: str
    seed: int
    settings: settings_lib.Settings
    minutes: float | None
    output_dir: pathlib.Path
    num_threads: int | None = None
    device: str | None = None

    def __post_init__(self) -> None:
        """Raises `ValueError`, which says what is valid, if an option is not."""
        checks.one_of('convention', self.convention, conventions.CONVENTIONS)
        if self.seed < 0:
            raise ValueError(f'seed must be a non-negative integer, got {self.seed}.')
        if self.minutes is not None and not 0 < self.minutes < math.inf:
            raise ValueError(f'minutes must be positive and finite, got {self.minutes}.')
        if self.device is not None and self.num_threads is not None:
            raise ValueError('num_threads are of the native batch, and not of a device.')

    def make_batch(self, task: str, num_envs: int, **task_kwargs) -> Any:
        """Returns a batch of environments, which gives NumPy's arrays."""
        if self.device is None:
            return BatchEnvironment(task, num_envs, self.num_threads, **task_kwargs)
        from fetch_composer.warp_batch import WarpBatchEnvironment, as_numpy

        return WarpBatchEnvironment(task, num_envs, self.device, convert=as_numpy, **task_kwargs)

    @property
    def command(self) -> str:
        """The command that makes this run."""
        usual = settings_lib.for_task(self.task)
        words = [f'python -m fetch_composer.learning --task {self.task}']
        words.append(f'--convention {self.convention} --seed {self.seed}')
        if self.device is not None:
            words.append(f'--device {self.device}')
        if self.minutes is not None:
            words.append(f'--minutes {self.minutes:g}')
        for name in settings_lib.names():
            value = getattr(self.settings, name)
            if value != getattr(usual, name):
                shown = ','.join(map(str, value)) if isinstance(value, tuple) else value
                words.append(f'--set {name}={shown}')
        return ' '.join(words)

    @property
    def decisive(self) -> dict[str, Any]:
        """What decides on the run, fit for JSON: the same is needed to continue it."""
        settings = dataclasses.asdict(self.settings)
        settings['hidden'] = list(self.settings.hidden)
        decisive = {
            'task': self.task,
            'convention': self.convention,
            'seed': self.seed,
            'settings': settings,
        }
        return decisive if self.device is None else {**decisive, 'device': self.device}


class _Clock:
    """Minutes that a run took, those before it was continued included."""

    def __init__(self) -> None:
        self._before = np.zeros(2)
        self._start = np.array((time.monotonic(), time.process_time()))

    def minutes(self) -> np.ndarray:
        """Returns (2,) minutes: of the wall clock, and of the processor."""
        now = np.array((time.monotonic(), time.process_time()))
        return self._before + (now - self._start) / 60

    def restore(self, minutes: np.ndarray) -> None:
        """Adds what a run took before."""
        self._before = np.asarray(minutes)


class Run:
    """One run, which continues where a checkpoint in its folder left off."""

    def __init__(
        self, options: Options, on_progress: Callable[[curve.Point], None] | None = None
    ) -> None:
        """Initializes the run, from a checkpoint if there is one.

        Args:
            options: What to learn.
            on_progress: Is called with each new point of the curve.

        Raises:
            ValueError: if the folder holds another run, or one that is still at work.
            OSError: if the folder cannot be written to.
        """
        self._options = options
        self._on_progress = on_progress or (lambda point: None)
        self._clock = _Clock()
        files.prepare_folder(options.output_dir)
        self._lock = FolderLock(options.output_dir)
        try:
            self._open()
        except BaseException:
            self._lock.close()
            raise

    def _open(self) -> None:
        options = self._options
        state = checkpoint.load(options.output_dir, options.decisive)
        files.clear_parts(options.output_dir)
        self.points: list[curve.Point] = []
        self.is_continued = state is not None
        self._relay_counts = np.zeros(2, int)  # Control steps and updates of Reach.
        relay = self._relay(state) if self._needs_relay else None
        self._trainer = Trainer(
            options.task,
            options.convention,
            options.seed,
            options.settings,
            relay,
            options.make_batch,
        )
        if state is not None:
            self._trainer.restore(_part('trainer', state))
            self._clock.restore(state['minutes'])
            self.points = [_point(row) for row in state['points']]
            # A kill between the two leaves the curve behind the checkpoint.
            self._save_curve()

    @property
    def _needs_relay(self) -> bool:
        options = self._options
        return options.task != _RELAY_TASK and options.settings.relay_share > 0

    @property
    def policy(self) -> networks.Policy:
        """What has been learned so far."""
        return self._trainer.policy

    def run(self) -> dict[str, Any]:
        """Learns to the end, writes all files, and returns what is in summary.json.

        Raises:
            DivergedError: if the networks diverge; the last checkpoint is kept.
        """
        trainer, settings = self._trainer, self._options.settings
        while not trainer.is_done and not self._is_late():
            trainer.iterate()
            if trainer.iterations % settings.evaluate_every == 0 or trainer.is_done:
                self._add_point()
        return self._finish()

    def close(self) -> None:
        """Frees the simulations, and lets other runs into the folder."""
        self._trainer.close()
        self._lock.close()

    def _is_late(self) -> bool:
        limit = self._options.minutes
        return limit is not None and self._clock.minutes()[0] >= limit

    def _relay(self, state: Mapping[str, np.ndarray] | None) -> Relay:
        """Returns the policy of Reach: from the checkpoint, or learned now."""
        options, own = self._options, self._options.settings
        if not own.relay_steps:
            self._relay_state = {}
            return Relay(Still(), np.zeros(layout.WITHOUT_OBJECT.size))
        reach = settings_lib.for_task(_RELAY_TASK)
        # Episodes of many environments, or long ones, would be over before anything is learned.
        settings = dataclasses.replace(
            reach,
            environment_steps=own.relay_steps,
            num_envs=min(own.num_envs, reach.num_envs),
            # It is learned with half as many as the task, but not with next to none.
            updates_per_step=max(own.updates_per_step / 2, reach.updates_per_step),
        )
        at_random = settings.random_iterations * settings.num_envs * settings.episode_steps
        if own.relay_steps <= at_random:
            raise ValueError(
                f'relay_steps must be more than {at_random}, in which Reach is explored at random, '
                f'got {own.relay_steps}; relay_share=0 does without a relay.'
            )
        trainer = Trainer(
            _RELAY_TASK, options.convention, options.seed, settings, None, options.make_batch
        )
        if state is None:
            while not trainer.is_done:
                trainer.iterate()
            policy, start = trainer.policy, trainer.start
            self._relay_counts = np.array((trainer.environment_steps, trainer.updates))
        else:
            policy = unflatten('relay', trainer.policy, state)
            start, self._relay_counts = state['relay_start'], state['relay_counts']
        trainer.close()
        self._relay_state = {
            **flatten('relay', policy),
            'relay_start': start,
            'relay_counts': self._relay_counts,
        }
        return Relay(policy, start)

    def _add_point(self) -> None:
        trainer = self._trainer
        steps, updates = self._relay_counts + (trainer.environment_steps, trainer.updates)
        success = float(trainer.evaluate().mean())
        minutes, cpu_minutes = self._clock.minutes()
        point = curve.Point(
            int(steps),
            int(updates),
            float(minutes),
            float(cpu_minutes),
            success,
            trainer.exploring_success,
            trainer.loss,
        )
        self.points.append(point)
        self._save()
        self._on_progress(point)

    def _method(self) -> str:
        how = 'learned from scratch by TD3 with hindsight relabelling, sparse reward'
        if self._needs_relay and self._options.settings.relay_steps:
            how += '; exploring relays from a policy of Reach that was learned in the same run'
        return how

    def _save(self) -> None:
        options = self._options
        state = {f'trainer/{name}': each for name, each in self._trainer.state().items()}
        if self._needs_relay:
            state |= self._relay_state
        state['minutes'] = self._clock.minutes()
        state['points'] = np.array([dataclasses.astuple(point) for point in self.points])
        checkpoint.save(options.output_dir, options.decisive, state)
        self._save_curve()

    def _save_curve(self) -> None:
        curve.save(self._options.output_dir / 'curve.csv', self.points)

    def _finish(self) -> dict[str, Any]:
        """Judges the policy on the held-out seeds and writes what is left to write."""
        from fetch_composer.learning import export

        options, trainer = self._options, self._trainer
        if trainer.iterations and trainer.iterations % options.settings.evaluate_every:
            self._save()
        minutes, cpu_minutes = self._clock.minutes()
        success = statistics.success_rate(trainer.evaluate(settings_lib.HELD_OUT_SEEDS))
        steps, updates = self._relay_counts + (trainer.environment_steps, trainer.updates)
        summary = {
            'method': self._method(),
            'command': options.command,
            'success_rate': success.value,
            'success_interval': [success.low, success.high],
            'episodes': len(settings_lib.HELD_OUT_SEEDS),
            'environment_steps': int(steps),
            'updates': int(updates),
            'relay_steps': int(self._relay_counts[0]),
            'minutes': round(float(minutes), 2),
            'cpu_minutes': round(float(cpu_minutes), 2),
            'minutes_limit': options.minutes,
            **options.decisive,
            'versions': {**provenance.versions(), 'jax': jax.__version__},
        }
        export.save(options.output_dir / 'policy.onnx', self.policy, trainer.observation_size)
        title = f'{options.task}, {options.convention}, seed {options.seed}'
        if self.points:
            curve.save_picture(options.output_dir / 'curve.png', self.points, title)
        files.save_json(options.output_dir / 'summary.json', summary)
        return summary


def _part(name: str, state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns the arrays whose names begin with `name/`, without it."""
    prefix = f'{name}/'
    return {key.removeprefix(prefix): each for key, each in state.items() if key.startswith(prefix)}


def _point(row: np.ndarray) -> curve.Point:
    steps, updates, *rest = row.tolist()
    return curve.Point(int(steps), int(updates), *rest)


__all__ = ('DivergedError', 'Options', 'Run')
