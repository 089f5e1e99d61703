"""Joins the tasks to libraries that may be imported later, or never, without importing them."""

import importlib.abc
import importlib.util
import sys
from collections.abc import Callable


def when_imported(name: str, join: Callable[[], None]) -> None:
    """Calls a function once a module is imported: at once if it is already.

    Args:
        name: Name of the module.
        join: What to call; it may import the module.
    """
    if sys.modules.get(name) is not None:
        join()
    else:
        sys.meta_path.insert(0, _Finder(name, join))


class _Finder(importlib.abc.MetaPathFinder):
    """Finds one module as others would, and calls a function after it has run."""

    def __init__(self, name: str, join: Callable[[], None]) -> None:
        self._name = name
        self._join = join

    def find_spec(self, fullname, path=None, target=None):
        del path, target  # Unused.
        if fullname != self._name:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(fullname)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def run_and_join(module) -> None:
                run(module)
                self._join()

            spec.loader.exec_module = run_and_join  # type: ignore[method-assign]
        return spec
