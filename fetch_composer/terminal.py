"""What the commands print reaches every terminal."""

import io
import sys


def print_whatever_there_is() -> None:
    """Lets standard output and error show a question mark for what they have no sign for."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # What tests put there takes everything.
            stream.reconfigure(errors='replace')
