"""Modules of the user's: their tasks and policies, installed or in the working folder."""

import ast
import hashlib
import importlib
import importlib.machinery
import os
import pathlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from types import ModuleType

_PACKAGE = pathlib.Path(__file__).parent.resolve()  # Which has a digest of its own.
_INSTALLED = frozenset(('site-packages', 'dist-packages'))
_IMPORTS_A_NAME = ('import_module', '__import__')
_RUNS_A_FILE = ('spec_from_file_location', 'run_path', 'run_module')


def load(name: str) -> ModuleType:
    """Returns a module, which is imported unless it has been.

    Args:
        name: Its name as in an import statement; the module may lie in the working folder.

    Raises:
        ValueError: if there is no such module, or it ends Python; the message says which.
    """
    if os.getcwd() not in sys.path and '' not in sys.path:
        sys.path.append(os.getcwd())
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f'{name}.'.startswith(f'{error.name}.'):
            raise  # Something that the module itself imports.
        raise ValueError(
            f'There is no module {name!r} in the working directory, and none is installed.'
        ) from None
    except SystemExit as error:
        raise ValueError(f'The module {name!r} calls sys.exit({error.code!r}).') from error


def load_all(names: Iterable[str]) -> None:
    """Imports modules in their order, so that the tasks that they register are known.

    Raises:
        ValueError: as `load` does.
    """
    for name in names:
        load(name)


def digest(name: str) -> str | None:
    """Returns a digest of an imported module and of all of its folder that it needs.

    That is what it, and what it imports, import from the folder that it lies in, wherever in their
    code. What is installed elsewhere counts by its version; of what is installed itself, the
    folder is its package's.

    Returns:
        None for a module that comes with Python.

    Raises:
        ValueError: if it cannot be told what the module consists of.
    """
    if name.partition('.')[0] in sys.stdlib_module_names:
        return None
    file = getattr(sys.modules.get(name), '__file__', None)
    if file is None:
        raise ValueError(
            f'The module {name!r} has no file, so that nothing can tell whether it has changed.'
        )
    path = _absolute(file)
    root = _root(name, path)
    total = hashlib.sha256()
    for each in sorted({path, *_needed(name, root)}):
        total.update(os.path.relpath(each, root).encode() + b'\0')
        total.update(hashlib.sha256(each.read_bytes()).digest())
    return total.hexdigest()


def _absolute(path: str) -> pathlib.Path:
    return pathlib.Path(os.path.abspath(path))


def _root(name: str, path: pathlib.Path) -> pathlib.Path:
    """Returns the folder that a module lies in: that of its package, if that is installed."""
    root = path.parents[name.count('.') + (path.stem == '__init__')]
    return root / name.partition('.')[0] if _is_installed(root) else root


def _is_installed(path: pathlib.Path) -> bool:
    return not _INSTALLED.isdisjoint(path.parts)


def _is_within(path: pathlib.Path, root: pathlib.Path) -> bool:
    """Returns whether a path counts: of the user's folder, and not installed within it."""
    return path.is_relative_to(root) and not (
        _is_installed(path.relative_to(root)) or path.is_relative_to(_PACKAGE)
    )


def _needed(name: str, root: pathlib.Path) -> set[pathlib.Path]:
    """Returns the files below a folder of all modules that a module needs; none is run."""
    found: set[pathlib.Path] = set()
    waiting, seen = [name], {name}
    while waiting:
        for module, path in _files(waiting.pop(), root):
            if path in found or not _is_within(path, root):
                continue
            found.add(path)
            for each in _imports(module, path):
                if each not in seen:
                    seen.add(each)
                    waiting.append(each)
    return found


def _files(name: str, root: pathlib.Path) -> Iterator[tuple[str, pathlib.Path]]:
    """Yields names and files of a module's packages, and its own, as far as a folder has them."""
    within = [each for each in sys.path if _is_within(_absolute(each), root)]
    places: Sequence[str] = [str(root.parent if _is_installed(root) else root), *within]
    parts = name.split('.')
    for length in range(1, len(parts) + 1):
        full = '.'.join(parts[:length])
        spec = importlib.machinery.PathFinder.find_spec(full, places)
        if spec is None:
            return
        if spec.origin is not None and spec.has_location:
            yield full, _absolute(spec.origin)
        places = list(spec.submodule_search_locations or ())


def _imports(module: str, path: pathlib.Path) -> Iterator[str]:
    """Yields the names of the modules that a file may import."""
    if path.suffix != '.py':
        return
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return  # It cannot be imported either.
    package = (module if path.stem == '__init__' else module.rpartition('.')[0]).split('.')
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = '.'.join(filter(None, [*above, node.module]))
            yield from filter(None, [base])
            yield from ('.'.join(filter(None, (base, each.name))) for each in node.names)
        elif isinstance(node, ast.Call):
            yield from _imported_by_call(node, path)


def _imported_by_call(node: ast.Call, path: pathlib.Path) -> Iterator[str]:
    name = getattr(node.func, 'attr', None) or getattr(node.func, 'id', None)
    if name in _IMPORTS_A_NAME and node.args:
        argument = getattr(node.args[0], 'value', None)
        if isinstance(argument, str) and len(node.args) == 1 and not argument.startswith('.'):
            yield argument
            return
    if name in (*_IMPORTS_A_NAME, *_RUNS_A_FILE):
        raise ValueError(
            f'{path}, line {node.lineno}: what {name} runs there cannot be told beforehand, nor '
            'whether it has changed since. Name it in an import statement.'
        )
