"""Code that stands in the documentation."""

import pathlib
import re

_DOCS = pathlib.Path(__file__).parents[1] / 'docs'


def code_of(page: str, number: int = 0) -> str:
    """Returns a piece of Python in a page of the documentation: the first, or a later one."""
    return codes_of(page)[number]


def codes_of(page: str) -> list[str]:
    """Returns all pieces of Python in a page of the documentation."""
    return re.findall(r'```python\n(.*?)```', (_DOCS / page).read_text(), re.DOTALL)
