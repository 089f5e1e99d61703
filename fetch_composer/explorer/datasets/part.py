"""Where a dataset lies until it is whole."""

import contextlib
import hashlib
import pathlib
import shutil
from collections.abc import Iterator

_PREFIX = '.fetch_composer_'


@contextlib.contextmanager
def folder(beside: pathlib.Path, owner: pathlib.Path) -> Iterator[pathlib.Path]:
    """Gives an empty hidden folder, and removes it with whatever is left in it.

    Args:
        beside: The folder that it lies in, and the dataset will.
        owner: The folder of the run, which no other one writes into at the same time. What an
            earlier one of it, that was killed, has left is removed.
    """
    name = hashlib.sha256(str(owner.resolve()).encode()).hexdigest()[:16]
    path = beside / f'{_PREFIX}{name}'
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(mode=0o700)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
