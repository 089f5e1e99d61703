"""Signals that stop a run at a place where nothing is lost."""

import contextlib
import signal
from collections.abc import Iterator


class Stopped(Exception):
    """Ends an episode that a signal has interrupted."""


@contextlib.contextmanager
def noted() -> Iterator[list[signal.Signals]]:
    """Gives a list to which SIGINT and SIGTERM are added, so that files are written to the end.

    A second signal interrupts at once.
    """
    found: list[signal.Signals] = []

    def note(number, frame) -> None:
        del frame  # Unused.
        if found:
            raise KeyboardInterrupt
        found.append(signal.Signals(number))

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield found
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
