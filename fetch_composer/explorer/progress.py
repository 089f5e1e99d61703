"""How far a run is: a bar in a terminal; elsewhere, such as in CI, a line every some seconds."""

import sys
from typing import Any, TextIO

import tqdm

_SECONDS_BETWEEN_REDRAWS = 0.5
_SECONDS_BETWEEN_LINES = 10
_COLUMNS = 80
_LONGEST_LABEL = 24


class Progress:
    """One bar, which shows one part of a run after the other."""

    def __init__(self, file: TextIO | None = None) -> None:
        """Initializes the bar, which is shown with the first part.

        Args:
            file: Where to write to; by default standard error.
        """
        file = file or sys.stderr
        self._bar: tqdm.tqdm | None = None
        self._options: dict[str, Any] = {'miniters': 1}
        if file.isatty():
            self._options |= {'file': file, 'dynamic_ncols': True}
            self._options |= {'mininterval': _SECONDS_BETWEEN_REDRAWS, 'leave': False}
        else:
            self._options |= {'file': _Lines(file), 'ncols': _COLUMNS, 'ascii': True}
            for name in ('mininterval', 'maxinterval'):
                self._options[name] = _SECONDS_BETWEEN_LINES

    def start(self, label: str, unit: str, total: int, done: int) -> None:
        """Begins a part.

        Args:
            label: What is being done.
            unit: What it is counted in.
            total: How many there are.
            done: How many were done before.
        """
        self.close()
        self._bar = tqdm.tqdm(
            desc=_shortened(label), total=total, initial=done, unit=unit, **self._options
        )

    def label(self, text: str) -> None:
        """Says what is being done now."""
        assert self._bar is not None
        self._bar.set_description(_shortened(text), refresh=False)

    def advance(self, count: int) -> None:
        """Adds to what is done."""
        assert self._bar is not None
        self._bar.update(count)

    def close(self) -> None:
        """Ends the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def __enter__(self) -> 'Progress':
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()


def _shortened(label: str) -> str:
    return label if len(label) <= _LONGEST_LABEL else f'...{label[3 - _LONGEST_LABEL :]}'


class _Lines:
    """Writes what is meant to replace a line as a line of its own."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> None:
        text = text.strip('\r\n ')
        if text:
            self._file.write(f'{text}\n')

    def flush(self) -> None:
        self._file.flush()
