"""A run: episodes of one policy, or of several on the same seeds, and the files about them."""

import contextlib
import dataclasses
import re
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import tqdm

import fetch_composer
from fetch_composer import policies
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.options import Options, file_name
from fetch_composer.explorer.pictures import filming, plots, rendering
from fetch_composer.explorer.report import page as report
from fetch_composer.explorer.results import compare, recording, store
from fetch_composer.explorer.results.candidate import Candidate

__all__ = ('Options', 'Run', 'Written')

TRAJECTORIES = 'trajectories.npz'
SUMMARY = 'summary.json'
REPORT = 'report.html'
PROGRESS = 'progress.png'
CONTACT_SHEET = 'contact_sheet.png'
_OWN_NAME = re.compile(
    r'(\d+_[\w.-]+/)?(trajectories\.npz|progress\.png|contact_sheet\.png|episode_\d{3,}\.mp4)'
)


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
    """Runs episodes, films some, and writes down what happened."""

    def __init__(self, options: Options, gl_backend: str | None, fresh: bool = False) -> None:
        """Checks every option before anything is run or written.

        Args:
            options: What to run.
            gl_backend: Name of the OpenGL backend in use, or None to take no pictures.
            fresh: Whether to discard an unfinished run in the folder rather than to continue it.

        Raises:
            ValueError: if an option is not valid, or the folder holds an unfinished run of
                other options; the message says what to do.
            PolicyError: if a policy fails at once.
            OSError: if nothing can be written into the folder.
        """
        options.check()
        self.options = options
        self._gl_backend = gl_backend
        self._env = fetch_composer.load(
            options.task, **options.of_episodes(options.policy[0]).task_kwargs
        )
        context = policies.PolicyContext.of(self._env)
        for policy in options.policy:
            make = policies.factory(policy, context, options.trust_pickle)
            batch_rollout.try_policy(policy, make, self._env.reset().observation, context)
        self._control_timestep = self._env.control_timestep()
        self._camera = rendering.Camera(self._env, options.camera, options.width, options.height)
        recording.prepare_folder(options.folder)
        self._store = store.Store(options.folder, self._identity(), fresh)
        self.candidates = [
            Candidate(policy, f'{number}_{file_name(policy)}', len(options.policy) == 1)
            for number, policy in enumerate(options.policy, start=1)
        ]
        self.stopped_by: signal.Signals | None = None
        self.continued = 0

    def close(self) -> None:
        """Frees the simulation and its OpenGL context, and lets go of the folder."""
        self._store.close()
        self._env.close()

    @property
    def finished(self) -> int:
        """Number of finished episodes, of all policies together."""
        return sum(len(each.episodes) for each in self.candidates)

    @property
    def results(self) -> list[str]:
        """Says of each policy, in one line, how its finished episodes went."""
        lines = []
        for each in self.candidates:
            if not each.episodes:
                continue
            figures = recording.summarize(each.episodes)
            distance_cm = 100 * figures['final_distance_m']['mean']
            lines.append(
                (f'{each.policy}: ' if len(self.candidates) > 1 else '')
                + f'At the goal at the last step: {100 * figures["success_rate"]:.1f} % of '
                f'{len(each.episodes)}; mean distance {distance_cm:.1f} cm; '
                f'mean return {figures["return"]["mean"]:.4g}; '
                f'{figures["control_steps_per_second"]:.0f} control steps/s in the environment.'
            )
        return lines

    def run(self) -> list[Written]:
        """Runs the episodes that are not finished yet, and writes the files.

        On SIGINT or SIGTERM the present episodes are dropped and `stopped_by` is set; files tell
        of those that are finished, and the same run made again continues there.

        Returns:
            The files, those to open first at the front; none if no episode was finished.

        Raises:
            PolicyError: if a policy fails.
            ReplayError: if a film does not show what happened.
        """
        started = time.perf_counter()
        with _signals_noted() as noted:

            def on_progress() -> None:
                if noted:
                    raise _Stopped

            with contextlib.suppress(_Stopped):
                self._run_episodes(on_progress)
                self._take_films(on_progress)
            # A signal that comes later finds nothing left to be stopped.
            self.stopped_by = noted[0] if noted and not self._is_complete else None
            if not self.finished:
                return []
            written = self._write(time.perf_counter() - started)
            if self._is_complete:
                written.extend(self._write_dataset())
                self._store.discard()
            return written

    @property
    def _is_complete(self) -> bool:
        return self.finished == len(self.candidates) * self.options.episodes and all(
            each.films.keys() == set(self._chosen()) for each in self.candidates
        )

    def _run_episodes(self, on_progress: Callable[[], None]) -> None:
        options = self.options
        for each in self.candidates:
            each.episodes = self._store.episodes(each.key, options.seeds)
        self.continued = self.finished
        with tqdm.tqdm(
            total=len(self.candidates) * options.episodes * options.max_episode_steps,
            initial=self.finished * options.max_episode_steps,
            unit='step',
            dynamic_ncols=True,
            mininterval=0.5,
        ) as bar:

            def advance(episodes: int) -> None:
                on_progress()
                bar.update(episodes)

            with self._rollouts(bar) as rollouts:
                for each in self.candidates:
                    bar.set_description(each.policy)
                    self._run_candidate(each, rollouts, advance)

    @contextlib.contextmanager
    def _rollouts(self, bar: tqdm.tqdm) -> Iterator[Callable[..., Any]]:
        """Gives what makes rollouts: here, or on a Ray cluster while that is needed."""
        if self.options.ray is None or bar.n == bar.total:
            yield batch_rollout.BatchRollout
            return
        from fetch_composer.explorer.episodes import ray_rollout

        bar.set_description(f'Ray, {self.options.ray}')
        with ray_rollout.cluster(self.options.ray) as rollouts:
            yield rollouts

    def _run_candidate(
        self,
        candidate: Candidate,
        rollouts: Callable[..., Any],
        on_progress: Callable[[int], None],
    ) -> None:
        options = self.options
        done = {episode.seed for episode in candidate.episodes}
        seeds = [seed for seed in options.seeds if seed not in done]
        if not seeds:
            return
        with rollouts(
            options.of_episodes(candidate.policy), min(options.num_envs, len(seeds))
        ) as batch:
            for episodes in batch.run(seeds, on_progress):
                self._store.add(candidate.key, episodes)
                candidate.episodes.extend(episodes)
        candidate.episodes.sort(key=lambda episode: episode.seed)

    def _chosen(self) -> list[int]:
        """Returns the indices of the episodes to film; none where no picture can be taken."""
        if self._gl_backend is None:
            return []
        distances = [[e.distance[-1] for e in each.episodes] for each in self.candidates]
        return filming.choose(distances, self.options.films, self.options.num_films)

    def _take_films(self, on_progress: Callable[[], None]) -> None:
        options, chosen = self.options, self._chosen()
        look = f'{options.camera.replace("/", "_")}_{options.width}x{options.height}_{options.fps}'
        with tqdm.tqdm(
            total=len(self.candidates) * len(chosen) * (options.max_episode_steps + 1),
            unit='frame',
            desc='films',
            dynamic_ncols=True,
            mininterval=0.5,
            disable=not chosen,
        ) as bar:

            def advance(step: int) -> None:
                del step  # Unused.
                on_progress()
                bar.update()

            for each in self.candidates:
                folder = self._store.folder(each.key, f'films_{look}')
                studio = filming.Studio(folder, self._env, self._camera, options.fps)
                for index in chosen:
                    episode = each.episodes[index]
                    film = studio.kept(episode)
                    if film is None:
                        film = studio.film(episode, advance)
                    else:
                        bar.update(options.max_episode_steps + 1)
                    each.films[index] = film

    def _write(self, wall_seconds: float) -> list[Written]:
        folder = self.options.folder
        names_before = recording.load_json(folder / SUMMARY).get('files', ())
        candidates = [each for each in self.candidates if each.episodes]
        for each in candidates:
            (folder / each.path('')).mkdir(exist_ok=True)
        comparisons = self._comparisons()
        self._write_report(candidates, comparisons)
        written = [
            Written((REPORT,), 'all of it on one page, films included'),
            *self._write_pictures([each for each in candidates if each.films]),
            *self._write_data(candidates),
        ]
        names = [name for each in written for name in each.names]
        summary = self._summary(wall_seconds, comparisons)
        recording.save_json(folder / SUMMARY, {**summary, 'files': names})

        # A film of an earlier and longer run would be taken for one of this run.
        for name in set(names_before) - set(names):
            if isinstance(name, str) and _OWN_NAME.fullmatch(name):
                (folder / name).unlink(missing_ok=True)
                with contextlib.suppress(OSError):  # Of the folder itself, or one not empty.
                    (folder / name).parent.rmdir()
        return written

    def _comparisons(self) -> list[compare.Comparison]:
        """Returns the comparison of the first policy with each other."""
        first, *others = self.candidates
        compared = [
            compare.compare(first.policy, first.episodes, each.policy, each.episodes)
            for each in others
        ]
        return [each for each in compared if each is not None]

    def _write_report(
        self, candidates: Sequence[Candidate], comparisons: Sequence[compare.Comparison]
    ) -> None:
        task = self._env.task
        page = report.render(
            self.options,
            candidates,
            comparisons,
            report.Setting(task.workspace, task.scene.block is not None, self._control_timestep),
            recording.versions(),
            stopped=self.stopped_by is not None,
        )
        recording.save_text(self.options.folder / REPORT, page)

    def _write_pictures(self, candidates: Sequence[Candidate]) -> list[Written]:
        sheets, films = [], []
        for each in candidates:
            strips = [
                rendering.Strip(index, each.episodes[index], film.thumbnails)
                for index, film in list(each.films.items())[: rendering.MAX_ROWS]
            ]
            title = self._title(each)
            if len(strips) < len(each.episodes):
                title += f' · {len(strips)} are shown'
            sheets.append(each.path(CONTACT_SHEET))
            rendering.save_contact_sheet(
                self.options.folder / sheets[-1], strips, title, self._control_timestep
            )
            for index, film in each.films.items():
                films.append(each.film_path(index))
                recording.copy(film.path, self.options.folder / films[-1])
        if not films:
            return []
        return [
            Written(sheets, 'a row of pictures for each film'),
            Written(sorted(films), 'films'),
        ]

    def _write_data(self, candidates: Sequence[Candidate]) -> list[Written]:
        folder = self.options.folder
        for each in candidates:
            plots.save_progress(
                folder / each.path(PROGRESS),
                each.episodes,
                self._title(each),
                self._control_timestep,
            )
            recording.save_trajectories(folder / each.path(TRAJECTORIES), each.episodes)
        return [
            Written(
                [each.path(PROGRESS) for each in candidates],
                'distance to the goal and return over time',
            ),
            Written(
                [each.path(TRAJECTORIES) for each in candidates],
                'observations, actions and rewards, for numpy.load',
            ),
            Written((SUMMARY,), 'success rate, return, distance, speed, versions, flags'),
        ]

    def _write_dataset(self) -> list[Written]:
        if self.options.dataset is None:
            return []
        from fetch_composer.explorer.results import minari_dataset

        (candidate,) = self.candidates
        folder = minari_dataset.save(
            self.options.dataset,
            self.options.of_episodes(candidate.policy),
            candidate.episodes,
        )
        return [Written([str(folder.resolve())], f'minari.load_dataset({self.options.dataset!r})')]

    def _title(self, candidate: Candidate) -> str:
        """Says in one line what was run and how it went."""
        reached = sum(episode.is_success for episode in candidate.episodes)
        return (
            f'{self.options.task} · {candidate.policy} · {self.options.convention}: '
            f'{reached} of {len(candidate.episodes)} end at the goal'
        )

    def _identity(self) -> dict[str, Any]:
        options = dataclasses.asdict(self.options.of_episodes(''))
        del options['policy'], options['trust_pickle']
        return {
            **options,
            'policies': [[each, policies.digest(each)] for each in self.options.policy],
            'versions': recording.versions(),
            'code': store.code_digest(),
        }

    def _summary(
        self, wall_seconds: float, comparisons: Sequence[compare.Comparison]
    ) -> dict[str, Any]:
        summary = {
            'flags': dataclasses.asdict(self.options),
            'episodes_finished': self.finished,
            'stopped_by': self.stopped_by.name if self.stopped_by else None,
            'wall_seconds': round(wall_seconds, 2),
            'gl_backend': self._gl_backend,
            'versions': recording.versions(),
        }
        if len(self.candidates) == 1:
            return {**summary, **recording.summarize(self.candidates[0].episodes)}
        return {
            **summary,
            'comparisons': [each.figures() for each in comparisons],
            'policies': [
                {'policy': each.policy, **recording.summarize(each.episodes)}
                for each in self.candidates
                if each.episodes
            ],
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
