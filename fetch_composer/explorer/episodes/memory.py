"""How many episodes fit into memory, which holds all of a run until its files are written."""

import os
import pathlib

from fetch_composer.tasks import layout

_COPIES = 4  # Of every number: as it was kept, stacked, drawn, and compressed.
_BYTES_ASIDE = 40_000  # Of an episode: its lines in plots, its rows in the report.
_MOST_OBJECTS = 2  # Of a task: how many there are is not known before it is made.
_SHARE = 0.5  # Of the memory, of which others want some.
_UNKNOWN = 8 * 2**30
_CGROUP_LIMITS = (
    '/sys/fs/cgroup/memory.max',
    '/sys/fs/cgroup/memory/memory.limit_in_bytes',
)


def most_episodes(steps: int) -> int:
    """Returns how many episodes of so many control steps fit into memory."""
    observed = layout.of(_MOST_OBJECTS)[0].size + 2 * 3 * _MOST_OBJECTS
    numbers = (steps + 1) * observed + steps * (4 + 1)
    return int(_SHARE * _memory()) // (8 * numbers * _COPIES + _BYTES_ASIDE)


def _memory() -> int:
    """Returns the bytes of memory that there are for this process."""
    found = []
    try:
        found.append(os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES'))
    except (AttributeError, OSError, ValueError):  # Not on every system.
        found.append(_UNKNOWN)
    for path in _CGROUP_LIMITS:
        try:
            found.append(int(pathlib.Path(path).read_text()))
        except (OSError, ValueError):  # There is no limit, or no such group.
            continue
    return min(found)
