"""A folder that one process at a time may write into."""

import os
import pathlib

try:
    import fcntl
except ModuleNotFoundError:  # On Windows nothing keeps two runs apart.
    fcntl = None  # type: ignore[assignment]


class FolderLock:
    """Keeps other processes out of a folder until it is closed, or its owner dies."""

    def __init__(self, folder: pathlib.Path, shown: pathlib.Path | None = None) -> None:
        """Locks a folder.

        Args:
            folder: The folder, which is there.
            shown: What the message calls it.

        Raises:
            ValueError: if another process is at work in it.
        """
        self._folder: int | None = None
        if fcntl is None:
            return
        # Not through a link that someone has put in its place.
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(opened)
            raise ValueError(
                f'Another run is at work in {shown or folder}: wait for it, or choose another '
                '--output_dir.'
            ) from None
        self._folder = opened

    def close(self) -> None:
        """Lets other processes in; closing twice does no harm."""
        if self._folder is not None:
            os.close(self._folder)
            self._folder = None
