"""Files that are written whole or not at all."""

import contextlib
import hashlib
import json
import os
import pathlib
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

_PART = '.fetch_composer_part_'  # And a random name: a folder that only its maker can write to.


@contextlib.contextmanager
def whole_file(path: pathlib.Path) -> Iterator[pathlib.Path]:
    """Gives a path to write to, which takes the place of `path` once all is written.

    If writing fails or is interrupted, `path` stays what it was. Nothing that others may have put
    into the folder, such as a link, is written through.
    """
    with tempfile.TemporaryDirectory(
        prefix=_PART, dir=path.parent, ignore_cleanup_errors=True
    ) as folder:
        partial = pathlib.Path(folder, path.name)
        yield partial
        os.replace(partial, path)


def clear_parts(folder: pathlib.Path, recursive: bool = False) -> None:
    """Removes what a process that was killed while it wrote has left in a folder.

    No other process may write into it.

    Args:
        folder: The folder, which need not be there.
        recursive: Whether to look into the folders in it as well.
    """
    for path in folder.rglob(f'{_PART}*') if recursive else folder.glob(f'{_PART}*'):
        shutil.rmtree(path, ignore_errors=True)


def remove_folder(path: pathlib.Path) -> None:
    """Removes what lies, as a folder, where a file of this program's own belongs."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)


def prepare_folder(folder: pathlib.Path) -> None:
    """Makes a folder, unless it is there, and makes sure that files can be written into it.

    Raises:
        OSError: if they cannot.
        ValueError: if its name is not valid UTF-8, which reports and networks' files are.
    """
    try:
        str(folder).encode()
    except UnicodeEncodeError:
        raise ValueError(f'output_dir must be valid UTF-8, got {str(folder)!r}.') from None
    folder.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryDirectory(prefix=_PART, dir=folder).cleanup()


def save_arrays(
    path: pathlib.Path, arrays: Mapping[str, np.ndarray], compressed: bool = False
) -> None:
    """Writes arrays to an npz file; compress those that are kept."""
    save = np.savez_compressed if compressed else np.savez
    with whole_file(path) as partial:
        save(partial, allow_pickle=False, **arrays)


class UnreadableError(ValueError):
    """A file of arrays is not there, or is not what was written."""


def load_arrays(path: pathlib.Path) -> dict[str, np.ndarray]:
    """Returns what `save_arrays` has written, for whose sums zip files vouch.

    Raises:
        UnreadableError: if it cannot be read, whatever has happened to it.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except Exception as error:  # Of zipfile, zlib, struct, numpy, and of the system.
        raise UnreadableError(f'{path} cannot be read ({type(error).__name__}: {error})') from error


def digest(path: pathlib.Path) -> str:
    """Returns a digest of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def copy(source: pathlib.Path, path: pathlib.Path) -> None:
    """Copies a file."""
    with whole_file(path) as partial:
        shutil.copyfile(source, partial)


def save_json(path: pathlib.Path, content: Mapping[str, Any]) -> None:
    """Writes an indented JSON file."""
    save_text(path, json.dumps(content, indent=2) + '\n')


def save_text(path: pathlib.Path, text: str) -> None:
    """Writes a text file."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding='utf-8')


def load_json(path: pathlib.Path) -> dict[str, Any]:
    """Returns what is in a JSON file; an empty dictionary if it cannot be read."""
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
