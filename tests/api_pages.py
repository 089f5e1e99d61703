"""Prints what the site's pages of the API name and is not there: python -m tests.api_pages.

Like Sphinx, it lets something stand in for what is of packages that the site is made without.
"""

import importlib.abc
import importlib.machinery
import importlib.util
import pathlib
import pkgutil
import re
import sys
import types

from docs import conf

_PAGES = pathlib.Path(conf.__file__).parent / 'api'
_NAME = re.compile(r'^\.\. auto\w+:: (\S+)$', re.MULTILINE)
_ON_A_DEVICE = 'fetch_composer.warp_batch'


class _Nothing:
    """Stands in for a class: it can be derived from, and no more."""

    def __mro_entries__(self, bases: tuple) -> tuple:
        return ()


class _StandIn(types.ModuleType):
    def __getattr__(self, name: str) -> _Nothing:
        if name.startswith('__'):
            raise AttributeError(name)
        return _Nothing()


class _StandIns(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, fullname, path, target=None):
        if fullname.partition('.')[0] in conf.autodoc_mock_imports:
            return importlib.machinery.ModuleSpec(fullname, self, is_package=True)
        return None

    def create_module(self, spec) -> types.ModuleType:
        return _StandIn(spec.name)

    def exec_module(self, module) -> None:
        pass


def names() -> list[str]:
    """Returns the names on the pages of the API."""
    return [
        name for page in sorted(_PAGES.glob('*.md')) for name in _NAME.findall(page.read_text())
    ]


def main() -> None:
    """Looks up each name; those of Warp only where it is installed."""
    sys.meta_path.insert(0, _StandIns())
    for name in names():
        if name.startswith(_ON_A_DEVICE) and importlib.util.find_spec('warp') is None:
            continue
        try:
            pkgutil.resolve_name(name)
        except Exception as error:  # Of whatever a module does when it is imported.
            print(f'{name}: {error}')


if __name__ == '__main__':
    main()
