"""A run: episodes of one policy on one task, and the files that tell of them."""

import contextlib
import dataclasses
import pathlib
import re
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import tqdm

from fetch_composer.exploration import plots, recording, rendering, rollout

TRAJECTORIES = 'trajectories.npz'
SUMMARY = 'summary.json'
PROGRESS = 'progress.png'
CONTACT_SHEET = 'contact_sheet.png'
_FIXED_NAMES = (TRAJECTORIES, SUMMARY, PROGRESS, CONTACT_SHEET)
_FILM_NAME = re.compile(r'episode_\d{3,}\.mp4')


def _film_name(index: int) -> str:
    return f'episode_{index:03d}.mp4'


@dataclasses.dataclass(frozen=True)
class Options:
    """What to run and how to film it.

    Attributes:
        task: Name of the task.
        policy: Name of the policy.
        episodes: Number of episodes.
        seed: Seed of the first episode; each has the next one.
        convention: 'documented' or 'gymnasium'.
        reward_type: 'sparse' or 'dense'.
        max_episode_steps: Control steps of an episode.
        camera: Name of a camera.
        width: Width of the film in pixels.
        height: Height of the film in pixels.
        fps: Frames per second of the film, which has a frame for every control step.
        output_dir: Folder to write into; None for `output/<task>_<policy>`.
    """

    task: str
    policy: str
    episodes: int
    seed: int
    convention: str
    reward_type: str
    max_episode_steps: int
    camera: str
    width: int
    height: int
    fps: int
    output_dir: str | None

    def check(self) -> None:
        """Raises `ValueError`, which says what is valid, if a number is out of range."""
        if self.episodes < 1:
            raise ValueError(f'episodes must be a positive integer, got {self.episodes}.')
        if self.seed < 0:
            raise ValueError(f'seed must be a non-negative integer, got {self.seed}.')
        rendering.check_film_format(self.width, self.height, self.fps)

    @property
    def folder(self) -> pathlib.Path:
        """The folder to write into."""
        return pathlib.Path(self.output_dir or f'output/{self.task}_{self.policy}')


@dataclasses.dataclass(frozen=True)
class Written:
    """Files of one kind that a run has written into its folder.

    Attributes:
        names: Their names.
        content: What is in them.
    """

    names: Sequence[str]
    content: str


class Run:
    """Runs episodes, films each, and writes down what happened."""

    def __init__(self, options: Options, gl_backend: str | None) -> None:
        """Checks every option before anything is run or written.

        Args:
            options: What to run.
            gl_backend: Name of the OpenGL backend in use, or None to take no pictures.

        Raises:
            ValueError: if an option is not valid; the message says what would be.
            OSError: if nothing can be written into the folder.
        """
        options.check()
        self.options = options
        self._gl_backend = gl_backend
        self._rollout = rollout.Rollout(
            options.task,
            options.policy,
            convention=options.convention,
            reward_type=options.reward_type,
            max_episode_steps=options.max_episode_steps,
        )
        self._control_timestep = self._rollout.env.control_timestep()
        self._camera = rendering.Camera(
            self._rollout.env, options.camera, options.width, options.height
        )
        recording.prepare_folder(options.folder)
        self.stopped_by: signal.Signals | None = None
        self.episodes: list[rollout.Episode] = []
        self._strips: list[rendering.Strip] = []

    def close(self) -> None:
        """Frees the simulation and its OpenGL context."""
        self._rollout.env.close()

    @property
    def title(self) -> str:
        """Says in one line what was run and how it went."""
        options = self.options
        reached = sum(episode.is_success for episode in self.episodes)
        return (
            f'{options.task} · {options.policy} · {options.convention}: '
            f'{reached} of {len(self.episodes)} end at the goal'
        )

    @property
    def result(self) -> str:
        """Says in one line how the finished episodes went."""
        figures = recording.summarize(self.episodes)
        distance_cm = 100 * figures['final_distance_m']['mean']
        return (
            f'At the goal at the last step: {100 * figures["success_rate"]:.1f} % of '
            f'{len(self.episodes)}; mean distance {distance_cm:.1f} cm; '
            f'mean return {figures["return"]["mean"]:.4g}; '
            f'{figures["control_steps_per_second"]:.0f} control steps/s in the environment.'
        )

    def run(self) -> list[Written]:
        """Runs the episodes and writes the files.

        On SIGINT or SIGTERM the present episode is dropped and `stopped_by` is set; files tell
        of those before it.

        Returns:
            The files, those to open first at the front; none if no episode was finished.
        """
        options, started = self.options, time.perf_counter()
        with (
            _signals_noted() as noted,
            tqdm.tqdm(
                total=options.episodes * options.max_episode_steps,
                unit='step',
                dynamic_ncols=True,
                mininterval=0.5,
            ) as bar,
        ):

            def observe(step: int) -> None:
                if noted:
                    raise _Stopped
                bar.update(step > 0)

            with contextlib.suppress(_Stopped):
                for index in range(options.episodes):
                    bar.set_description(f'episode {index + 1} of {options.episodes}')
                    self._run_episode(options.seed + index, observe)
            bar.close()
            if len(self.episodes) < options.episodes:
                self.stopped_by = noted[0]
            return self._write(time.perf_counter() - started) if self.episodes else []

    def _run_episode(self, seed: int, observe: Callable[[int], None]) -> None:
        if self._gl_backend is None:
            self.episodes.append(self._rollout.run(seed, observe))
            return
        options, thumbnails = self.options, []
        shown = rendering.shown_steps(options.max_episode_steps)
        path = options.folder / _film_name(len(self.episodes))
        with rendering.film(path, options.fps) as add_picture:

            def film(step: int) -> None:
                observe(step)
                picture = self._camera.picture()
                add_picture(picture)
                if step in shown:
                    thumbnails.append(rendering.thumbnail(picture))

            episode = self._rollout.run(seed, film)
        self.episodes.append(episode)
        if len(self._strips) < rendering.MAX_ROWS:
            self._strips.append(rendering.Strip(episode, thumbnails))

    def _write(self, wall_seconds: float) -> list[Written]:
        folder = self.options.folder
        names_before = recording.load_json(folder / SUMMARY).get('files', ())
        written = []
        if self._gl_backend is not None:
            title = self.title
            if len(self._strips) < len(self.episodes):
                title += f' · the first {len(self._strips)} are shown'
            rendering.save_contact_sheet(
                folder / CONTACT_SHEET, self._strips, title, self._control_timestep
            )
            films = tuple(_film_name(index) for index in range(len(self.episodes)))
            written += [
                Written((CONTACT_SHEET,), 'a row of pictures for each episode'),
                Written(films, 'a film of each episode'),
            ]
        plots.save_progress(folder / PROGRESS, self.episodes, self.title, self._control_timestep)
        recording.save_trajectories(folder / TRAJECTORIES, self.episodes)
        written += [
            Written((PROGRESS,), 'distance to the goal and return over time'),
            Written((TRAJECTORIES,), 'observations, actions and rewards, for numpy.load'),
            Written((SUMMARY,), 'success rate, return, distance, speed, versions, flags'),
        ]
        names = [name for each in written for name in each.names]
        summary = self._summary(wall_seconds)
        recording.save_json(folder / SUMMARY, {**summary, 'files': names})

        # A film of an earlier and longer run would be taken for one of this run.
        for name in set(names_before) - set(names):
            if name in _FIXED_NAMES or _FILM_NAME.fullmatch(name):
                (folder / name).unlink(missing_ok=True)
        return written

    def _summary(self, wall_seconds: float) -> dict[str, Any]:
        return {
            'flags': dataclasses.asdict(self.options),
            'episodes_finished': len(self.episodes),
            'stopped_by': self.stopped_by.name if self.stopped_by else None,
            'wall_seconds': round(wall_seconds, 2),
            'gl_backend': self._gl_backend,
            'versions': recording.versions(),
            **recording.summarize(self.episodes),
        }


class _Stopped(Exception):
    """Ends an episode that a signal has interrupted."""


@contextlib.contextmanager
def _signals_noted() -> Iterator[list[signal.Signals]]:
    """Gives a list to which SIGINT and SIGTERM are added, so that files are written to the end.

    A second signal interrupts at once.
    """
    noted: list[signal.Signals] = []

    def note(number, frame) -> None:
        del frame  # Unused.
        if noted:
            raise KeyboardInterrupt
        noted.append(signal.Signals(number))

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
