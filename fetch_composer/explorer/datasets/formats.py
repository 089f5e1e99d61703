"""The formats of datasets, by the prefix under which they are asked for."""

import importlib
import pathlib
from typing import Protocol

from fetch_composer.explorer.datasets.contents import Contents
from fetch_composer.tasks import checks

# What follows each prefix. A module is imported only for its own, since it needs a library.
FORMATS = {'minari': 'NAME', 'ogbench': 'PATH.npz', 'lerobot': 'DIR'}
_DEFAULT = 'minari'


class Dataset(Protocol):
    """A dataset that may be there, or is to be written."""

    path: pathlib.Path
    reading: str
    needs_pictures: bool

    def check(self, seeds: range) -> None:
        """Raises `ValueError` if it cannot hold the episodes of these seeds."""

    def prepare(self) -> None:
        """Makes sure that a dataset can be written; raises `OSError` if none can."""

    def found(self) -> list[dict | None]:
        """Returns what is said of each of its parts; None for one that is not there."""

    def save(self, contents: Contents) -> None:
        """Writes each of its parts, whole or not at all."""

    def finish(self) -> None:
        """Does what is left to do once all parts are there, and may be done again."""


def dataset(target: str) -> Dataset:
    """Returns the dataset that a target names.

    Args:
        target: A prefix of `FORMATS` with what follows it, such as ogbench:push.npz; or a name
            of Minari's without one.

    Raises:
        ValueError: if there is no such format, or what follows is not valid; the message says
            what is.
        ImportError: if a library is missing; the message says what to install.
    """
    text = target if isinstance(target, str) else ':'
    prefix, colon, place = text.partition(':')
    if not colon:
        prefix, place = _DEFAULT, text
    if prefix not in FORMATS:
        valid = ', '.join(f'{name}:{what}' for name, what in FORMATS.items())
        raise ValueError(
            f'Unknown dataset {checks.shown(target)}; valid are {valid}, and NAME of {_DEFAULT}.'
        )
    module = importlib.import_module(f'{__package__}.{prefix}_format')
    return module.Dataset(place)
