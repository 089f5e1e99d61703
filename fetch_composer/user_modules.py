"""Modules of the user's: their tasks and policies, installed or in the working folder."""

import hashlib
import importlib
import os
import pathlib
import sys
from collections.abc import Iterable
from types import ModuleType


def load(name: str) -> ModuleType:
    """Returns a module, which is imported unless it has been.

    Args:
        name: Its name as in an import statement; the module may lie in the working folder.

    Raises:
        ValueError: if there is no such module; the message says which.
    """
    if os.getcwd() not in sys.path and '' not in sys.path:
        sys.path.append(os.getcwd())
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f'{name}.'.startswith(f'{error.name}.'):
            raise  # Something that the module itself imports.
        raise ValueError(
            f'There is no module {name!r} in the working directory, and none is installed.'
        ) from None


def load_all(names: Iterable[str]) -> None:
    """Imports modules in their order, so that the tasks that they register are known.

    Raises:
        ValueError: as `load` does.
    """
    for name in names:
        load(name)


def digest(name: str) -> str | None:
    """Returns a digest of an imported module's file; None if it has none."""
    path = getattr(sys.modules.get(name), '__file__', None)
    if path is None:
        return None
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
