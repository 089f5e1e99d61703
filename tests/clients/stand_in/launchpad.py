"""The part of dm-launchpad that Acme 0.4.0 needs to run a loop in one process.

Acme pins dm-launchpad 0.5.0, which is not on PyPI.
"""


def register_stop_handler(handler) -> None:
    """Does nothing: without Launchpad there is no one to stop the loop."""


def unregister_stop_handler(handler) -> None:
    """Does nothing."""
