"""Films that are taken in a process of their own.

OpenGL in software (Mesa) brings an LLVM with it, as does torch's compiler, and a process that loads
both can end with a segmentation fault. So policies act in a process that has no OpenGL.
"""

import contextlib
import dataclasses
import importlib.util
import os
import pathlib
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from fetch_composer import suite, user_modules
from fetch_composer.explorer.episodes import replay
from fetch_composer.explorer.episodes.batch_rollout import EpisodeOptions
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import film
from fetch_composer.tasks.camera import Camera

# The module that a task of the user's comes from may need torch, which has to be there before
# OpenGL is.
_COMMAND = """
import importlib, pickle, sys
sys.path[:], first = pickle.load(sys.stdin.buffer)
for each in first:
    importlib.import_module(each)
from fetch_composer.explorer.pictures import drawing
drawing.serve()
"""
_TORCH_COMPILER = 'torch._dynamo'
_SECONDS_TO_END = 10


class DrawingError(RuntimeError):
    """The process that takes the films has ended."""


@dataclasses.dataclass(frozen=True)
class Look:
    """How films look.

    Attributes:
        camera: Name of the camera.
        width: Width in pixels.
        height: Height in pixels.
        supersampling: A pixel is the mean of as many squared.
        fps: Frames per second.
    """

    camera: str
    width: int
    height: int
    supersampling: int
    fps: int

    @property
    def name(self) -> str:
        """A name for a folder of such films."""
        size = f'{self.width}x{self.height}x{self.supersampling}'
        return f'{self.camera.replace("/", "_")}_{size}_{self.fps}'


class Drawer:
    """Takes films of episodes, one after the other."""

    def __init__(self, options: EpisodeOptions, look: Look, gl_backend: str) -> None:
        """Starts the process, and does not wait for it.

        Args:
            options: What the episodes were run with; their policy does not matter.
            look: How the films are to look.
            gl_backend: Name of the OpenGL backend, as MUJOCO_GL takes it.
        """
        self.look = look
        self._is_filming = False
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, '-c', _COMMAND],
            env={**os.environ, 'MUJOCO_GL': gl_backend},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            start_new_session=True,  # Ctrl-C is for this process, which ends the other.
        )
        first = [_TORCH_COMPILER] if options.imports and importlib.util.find_spec('torch') else []
        self._send((sys.path, first))
        self._send((options, look))

    def take(
        self, folder: pathlib.Path, episode: Episode, on_progress: Callable[[int], None]
    ) -> film.Film:
        """Films an episode; see `film.take`.

        Raises:
            ReplayError: if the episode does not end as it did.
            OSError: if the film cannot be written.
            DrawingError: if the process has ended.
        """
        self._is_filming = True
        self._send((folder, episode))
        while (answer := self._receive()) is not None:
            if isinstance(answer, Exception):
                raise answer
            on_progress(answer)
        self._is_filming = False
        taken = film.kept(folder, episode)
        assert taken is not None
        return taken

    def pictures(self, episode: Episode) -> Iterator[np.ndarray]:
        """Yields a picture, (height, width, 3) uint8, of each observation of an episode.

        Raises:
            ReplayError: if the episode does not end as it did.
            DrawingError: if the process has ended.
        """
        self._is_filming = True
        self._send((None, episode))
        while (answer := self._receive()) is not None:
            if isinstance(answer, Exception):
                raise answer
            yield answer
        self._is_filming = False

    def _send(self, message: Any) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(message, self._process.stdin)
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._ended() from None

    def _receive(self) -> Any:
        assert self._process.stdout is not None
        try:
            return pickle.load(self._process.stdout)
        except EOFError:
            raise self._ended() from None

    def _ended(self) -> DrawingError:
        status = self._process.wait(_SECONDS_TO_END)
        self._errors.seek(0)
        lines = self._errors.read().decode(errors='replace').split('\n')
        said = next((line for line in reversed(lines) if line.strip()), 'it said nothing')
        return DrawingError(f'The process that takes the films ended with {status}: {said}')

    def close(self) -> None:
        """Ends the process; a film that is being taken is dropped, and so are pictures."""
        if not self._is_filming:
            self._process.kill()  # It would end by itself, but only once it has started.
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        try:
            self._process.wait(_SECONDS_TO_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def __enter__(self) -> 'Drawer':
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()


def serve() -> None:
    """Takes the films that a `Drawer` of another process asks for, until that one ends."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), 'wb', buffering=0)
    os.dup2(2, 1)  # What a library prints must not come between the answers.

    def answer(message: Any) -> None:
        answers.write(pickle.dumps(message))

    with contextlib.suppress(EOFError, BrokenPipeError):
        options, look = pickle.load(requests)
        user_modules.load_all(options.imports)
        env = suite.load(suite.DOMAIN, options.task, options.task_kwargs)
        with contextlib.closing(env):
            camera = Camera(env.physics, look.camera, look.height, look.width, look.supersampling)
            while True:
                folder, episode = pickle.load(requests)
                try:
                    if folder is None:
                        replay.replay(env, episode, lambda step: answer(camera.picture()))
                    else:
                        film.take(folder, episode, env, camera, look.fps, answer)
                except BrokenPipeError:
                    raise
                except (OSError, RuntimeError) as error:
                    answer(error)
                else:
                    answer(None)
