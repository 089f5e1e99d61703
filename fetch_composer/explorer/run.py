"""A run: episodes of one policy, or of several on the same seeds, and the files about them."""

import contextlib
import dataclasses
import json
import pathlib
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

from fetch_composer import policies, suite, user_modules
from fetch_composer.explorer import files, flags, progress, signals
from fetch_composer.explorer.datasets import contents, formats
from fetch_composer.explorer.datasets import writing as dataset_writing
from fetch_composer.explorer.episodes import batch_rollout, provenance, replay
from fetch_composer.explorer.options import Options, file_name
from fetch_composer.explorer.pictures import drawing, film
from fetch_composer.explorer.report import page, replay_page
from fetch_composer.explorer.results import (
    compare,
    evaluation,
    standard,
    store,
    summary,
    titles,
    writing,
)
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting
from fetch_composer.tasks import camera

__all__ = ('Options', 'Run')


class Run:
    """Runs episodes, films some, and writes down what happened."""

    def __init__(self, options: Options, gl_backend: str | None, fresh: bool = False) -> None:
        """Checks every option before anything is run or written.

        Args:
            options: What to run.
            gl_backend: Name of the OpenGL backend to use, or None to take no pictures.
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
        user_modules.load_all(options.imports)
        of_episodes = [options.of_episodes(policy) for policy in options.policies]
        self._env = suite.load(suite.DOMAIN, options.task, of_episodes[0].task_kwargs)
        if options.origin is not None:
            options.origin.check(self._env, options.seeds)
        context = policies.PolicyContext.of(self._env)
        observation = self._env.reset().observation
        self.candidates = [
            Candidate(
                each.policy,
                f'{number}_{file_name(each.policy)}',
                len(options.policies) == 1,
                batch_rollout.tried_policy(each, context, observation),
            )
            for number, each in enumerate(of_episodes, start=1)
        ]
        camera.check_name(self._env.physics, options.camera)
        identity = self._identity()
        self._dataset = None if options.dataset is None else formats.dataset(options.dataset)
        self._about: dict[str, Any] = {}
        if self._dataset is not None:
            look = self._look.name if self._dataset.needs_pictures else None
            self._about = contents.about(identity, self._env.task.identity, options.seeds, look)
            dataset_writing.check(self._dataset, self._about, gl_backend)
        files.prepare_folder(options.folder)
        self._store = store.Store(options.folder, identity, fresh)
        for folder in {options.folder, *(options.folder / c.path('') for c in self.candidates)}:
            files.clear_parts(folder)
        self.stopped_by: signal.Signals | None = None
        self.continued = 0
        self.remarks: list[str] = []  # Of what could not be done, each in a line.

    def close(self) -> None:
        """Frees the simulation, and lets go of the folder."""
        self._store.close()
        self._env.close()

    @property
    def finished(self) -> int:
        """Number of finished episodes, of all policies together."""
        return sum(len(each.episodes) for each in self.candidates)

    @property
    def results(self) -> list[str]:
        """Says how the finished episodes of each policy went."""
        if self._has_standard:
            return standard.table(self._evaluations())
        return [titles.result(each) for each in self.candidates if each.episodes]

    def run(self) -> list[writing.Written]:
        """Runs the episodes that are not finished yet, and writes the files.

        On SIGINT or SIGTERM the present episodes are dropped and `stopped_by` is set; files tell
        of those that are finished, and the same run made again continues there.

        Returns:
            The files, those to open first at the front; none if no episode was finished.

        Raises:
            PolicyError: if a policy fails.
            ReplayError: if a film does not show what happened; all else has been written.
            DrawingError: if films cannot be taken; all else has been written.
        """
        started = time.perf_counter()
        failure: Exception | None = None
        with signals.noted() as noted:

            def on_progress() -> None:
                if noted:
                    raise signals.Stopped

            with contextlib.suppress(signals.Stopped), contextlib.ExitStack() as stack:
                drawer = stack.enter_context(self._drawer(self.options.films != 'none'))
                bar = stack.enter_context(progress.Progress())
                self._run_episodes(bar, on_progress)
                if drawer is not None:
                    try:
                        self._take_films(drawer, bar, on_progress)
                    except (drawing.DrawingError, replay.ReplayError) as error:
                        failure = error
                    except OSError as error:
                        failure = drawing.DrawingError(f'A film could not be written: {error}')
            # A signal that comes later finds nothing left to be stopped.
            self.stopped_by = noted[0] if noted and not self._is_complete else None
            if not self.finished:
                return []
            written = self._write(time.perf_counter() - started)
            if failure is not None:
                raise failure
            if self._is_complete:
                try:
                    written.extend(self._write_dataset(on_progress))
                except signals.Stopped:
                    self.stopped_by = noted[0]
                    return written
                self._store.discard()
            return written

    @property
    def _has_standard(self) -> bool:
        return self.options.standard and self._is_complete

    def _evaluations(self) -> list[evaluation.Evaluation]:
        return [
            evaluation.of_episodes(self.options.of_episodes(each.policy), each.episodes)
            for each in self.candidates
        ]

    @property
    def _is_complete(self) -> bool:
        return self.finished == len(self.candidates) * self.options.episodes and all(
            each.films.keys() == set(self._chosen()) for each in self.candidates
        )

    def _drawer(self, is_needed: bool) -> contextlib.AbstractContextManager[drawing.Drawer | None]:
        """Returns what takes pictures; it gets ready while the episodes are run."""
        options = self.options
        if self._gl_backend is None or not is_needed:
            return contextlib.nullcontext()
        return drawing.Drawer(options.of_episodes(''), self._look, self._gl_backend)

    @property
    def _look(self) -> drawing.Look:
        options = self.options
        return drawing.Look(
            options.camera, options.width, options.height, options.supersampling, options.fps
        )

    def _run_episodes(self, bar: progress.Progress, on_progress: Callable[[], None]) -> None:
        options = self.options
        for each in self.candidates:
            each.episodes = self._store.episodes(each.key, options.seeds)
        self.continued = self.finished
        total = len(self.candidates) * options.episodes
        bar.start(options.policies[0], 'step', total * options.steps, self.finished * options.steps)

        def advance(steps: int) -> None:
            on_progress()
            bar.advance(steps)

        with self._rollouts(bar, is_needed=self.finished < total) as rollouts:
            for each in self.candidates:
                bar.label(each.policy)
                self._run_candidate(each, rollouts, advance)

    @contextlib.contextmanager
    def _rollouts(self, bar: progress.Progress, is_needed: bool) -> Iterator[Callable[..., Any]]:
        """Gives what makes rollouts: here, or on a Ray cluster while that is needed."""
        if self.options.ray is None or not is_needed:
            yield batch_rollout.BatchRollout
            return
        from fetch_composer.explorer.episodes import ray_rollout

        bar.label(f'Ray, {self.options.ray}')
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
            options.of_episodes(candidate.policy),
            min(options.num_envs, len(seeds)),
            make_policy=candidate.make_policy,
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
        return film.choose(distances, self.options.films, self.options.num_films)

    def _take_films(
        self, drawer: drawing.Drawer, bar: progress.Progress, on_progress: Callable[[], None]
    ) -> None:
        chosen = self._chosen()
        frames = sum(each.episodes[i].steps + 1 for each in self.candidates for i in chosen)
        bar.start('films', 'frame', frames, 0)

        def advance(step: int) -> None:
            del step  # Unused.
            on_progress()
            bar.advance(1)

        for each in self.candidates:
            folder = self._store.folder(each.key, f'films_{drawer.look.name}')
            for index in chosen:
                episode = each.episodes[index]
                kept = film.kept(folder, episode)
                if kept is not None:
                    bar.advance(episode.steps + 1)
                each.films[index] = kept or drawer.take(folder, episode, advance)

    def _write(self, wall_seconds: float) -> list[writing.Written]:
        candidates = [each for each in self.candidates if each.episodes]
        comparisons = compare.compare_all(self.candidates)
        setting = Setting.of(self._env)
        made: list[str] = []

        def make_replay() -> str | None:
            text = self._replay_page(candidates)
            made.extend([writing.REPLAY] if text is not None else [])
            return text

        def make_report() -> str:
            return page.render(
                self.options,
                candidates,
                comparisons,
                setting,
                provenance.versions(),
                stopped=self.stopped_by is not None,
                has_replay=bool(made),
            )

        figures = {
            'flags': flags.flag_values(self.options),
            'episodes_finished': self.finished,
            'stopped_by': self.stopped_by.name if self.stopped_by else None,
            'wall_seconds': round(wall_seconds, 2),
            'gl_backend': self._gl_backend,
            'versions': provenance.versions(),
            'code': provenance.code_digest(),
            **summary.of_run(candidates, comparisons),
        }
        if self._has_standard:
            figures['standard'] = [standard.cells(each) for each in self._evaluations()]
        pages = {writing.REPLAY: make_replay, writing.REPORT: make_report}
        return writing.write(self.options.folder, candidates, setting, pages, figures, self.remarks)

    def _replay_page(self, candidates: list[Candidate]) -> str | None:
        takes = replay_page.takes_of(candidates)
        if not takes:
            return None
        title = f'{self.options.task} · {" / ".join(self.options.policies)}'
        try:
            return replay_page.render(takes, self._env, self.options.camera, title)
        except replay_page.ReplayPageError as error:
            self.remarks.append(f'No {writing.REPLAY}: {error}')
            return None

    def _write_dataset(self, on_progress: Callable[[], None]) -> list[writing.Written]:
        if self._dataset is None:
            return []
        (candidate,) = self.candidates
        of_episodes = self.options.of_episodes(candidate.policy)
        holds = contents.Contents(of_episodes, candidate.episodes, self._about, self.options.folder)
        dataset_writing.write(self._dataset, holds, lambda: self._drawer(True), on_progress)
        return [writing.Written([str(self._dataset.path.resolve())], self._dataset.reading)]

    def _identity(self) -> dict[str, Any]:
        options, mesh = self.options, self.options.task_options.object_mesh
        identity = {
            'task': options.task,
            **dataclasses.asdict(options.task_options),
            'mesh': mesh and files.digest(pathlib.Path(mesh)),
            'policies': [[each, policies.digest(each)] for each in options.policies],
            'imports': [[each, user_modules.digest(each)] for each in options.imports],
            'versions': provenance.versions(),
            'code': provenance.code_digest(),
            'from_state': options.origin and [options.origin.digest(), options.step],
        }
        # As it will be read again: with lists for tuples and arrays.
        return json.loads(json.dumps(identity, default=list))
