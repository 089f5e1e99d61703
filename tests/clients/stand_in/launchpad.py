"""The part of dm-launchpad that Acme needs to run loops and experiments in one process.

Acme 0.4.0 pins dm-launchpad 0.5.0, which is not on PyPI.
"""


class Program:
    """What a distributed experiment would be."""


def register_stop_handler(handler) -> None:
    """Does nothing: without Launchpad there is no one to stop the loop."""


def unregister_stop_handler(handler) -> None:
    """Does nothing."""
