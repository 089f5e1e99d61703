"""Joins the tasks to libraries that may be imported later, or never, without importing them."""

import importlib.abc
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
        if fullname != self._name:
            return None
        others = [each for each in sys.meta_path if each is not self]
        spec = next(filter(None, (each.find_spec(fullname, path, target) for each in others)), None)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def run_and_join(module) -> None:
                run(module)
                # Not before: who looks for a module may not import it, or fail to.
                if self in sys.meta_path:
                    sys.meta_path.remove(self)
                    self._join()

            spec.loader.exec_module = run_and_join  # type: ignore[method-assign]
        return spec
