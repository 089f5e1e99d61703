"""Tables in Markdown: reading one from a page, and the places that commands write figures to.

A page has such a table between two comments:

    <!-- speed table: made by make bench -->
    ...
    <!-- end -->
"""

import itertools
import pathlib
from collections.abc import Sequence

_END = '<!-- end -->'


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    lines = [header, ['---'] * len(header), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def rows(path: pathlib.Path, header: str) -> list[list[str]]:
    """Returns the cells of the rows of a page's table.

    Args:
        path: The page.
        header: What the first line of the table starts with.

    Raises:
        ValueError: if the page has no such table, or several.
    """
    parts = path.read_text(encoding='utf-8').split(f'\n{header}')
    if len(parts) != 2:
        raise ValueError(f'{path} must have one table that starts with {header!r}.')
    lines = itertools.takewhile(lambda line: line.startswith('|'), parts[1].splitlines()[2:])
    return [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]


def has_markers(path: pathlib.Path, name: str) -> bool:
    """Returns whether a page has a place for a text; see `write_between_markers`."""
    return _find(path.read_text(encoding='utf-8'), name) is not None


def write_between_markers(path: pathlib.Path, name: str, text: str) -> None:
    """Replaces what a page has between `<!-- NAME -->` and the next `<!-- end -->`.

    Args:
        path: The page.
        name: What the first comment says.
        text: What is to stand there.

    Raises:
        ValueError: if the page has no such comments, or has them twice; the message names them.
    """
    page = path.read_text(encoding='utf-8')
    place = _find(page, name)
    if place is None:
        raise ValueError(f'{path} must have the lines {_start(name)} and {_END}, once.')
    start, end = place
    path.write_text(f'{page[:start]}\n{text.strip()}\n{page[end:]}', encoding='utf-8')


def _start(name: str) -> str:
    return f'<!-- {name} -->'


def _find(page: str, name: str) -> tuple[int, int] | None:
    """Returns where the text between the comments starts and ends; None if it is not clear."""
    before, *after = page.split(_start(name))
    if len(after) != 1 or _END not in after[0]:
        return None
    start = len(before) + len(_start(name))
    return start, start + after[0].index(_END)
