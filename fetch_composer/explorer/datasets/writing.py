"""Writes a dataset, unless it is there; what another run has written is never replaced."""

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from fetch_composer.explorer import progress
from fetch_composer.explorer.datasets.contents import RUN, Contents
from fetch_composer.explorer.datasets.formats import Dataset
from fetch_composer.explorer.pictures import drawing

_Drawer = contextlib.AbstractContextManager[drawing.Drawer | None]


def check(dataset: Dataset, about: Mapping[str, Any], gl_backend: str | None) -> None:
    """Makes sure that a run can write a dataset.

    Args:
        dataset: The dataset.
        about: What is said of the one to be written.
        gl_backend: Name of the OpenGL backend, or None where no picture can be taken.

    Raises:
        ValueError: if it cannot; the message says what to do.
    """
    if dataset.needs_pictures and gl_backend is None:
        raise ValueError(
            f'{dataset.path} would have pictures, and none can be taken here: install OpenGL, or '
            'choose another format.'
        )
    try:
        dataset.prepare()
    except OSError as error:
        raise ValueError(f'No dataset can be written: {error}.') from None
    _is_there(dataset, about)


def write(
    dataset: Dataset,
    contents: Contents,
    make_drawer: Callable[[], _Drawer],
    on_progress: Callable[[], None],
) -> None:
    """Writes a dataset, unless this very run has: one that was killed after it.

    Args:
        dataset: The dataset.
        contents: What it is made of; pictures and progress are added here.
        make_drawer: Makes what takes the pictures.
        on_progress: Called after each episode; what it raises leaves no dataset.

    Raises:
        ValueError: if something else is there by now.
        OSError: if it cannot be written.
    """
    if not _is_there(dataset, contents.about):
        with contextlib.ExitStack() as stack:
            bar = stack.enter_context(progress.Progress())
            bar.start('dataset', 'step', sum(each.steps for each in contents.episodes), 0)

            def advance(steps: int) -> None:
                on_progress()
                bar.advance(steps)

            if dataset.needs_pictures:
                drawer = stack.enter_context(make_drawer())
                assert drawer is not None
                contents = dataclasses.replace(contents, pictures=drawer.pictures)
            dataset.save(dataclasses.replace(contents, on_progress=advance))
    dataset.finish()


def _is_there(dataset: Dataset, about: Mapping[str, Any]) -> bool:
    found = dataset.found()
    if any(each is not None and each.get(RUN) != about[RUN] for each in found):
        raise ValueError(
            f'There is a dataset in {dataset.path} already, which another run has written: choose '
            'another one, or remove it.'
        )
    return all(each is not None for each in found)
