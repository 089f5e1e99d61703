"""Where episodes come from: the versions and the code that decide on every one."""

import hashlib
import importlib.metadata
import pathlib
import platform

_DISTRIBUTIONS = ('fetch_composer', 'dm-control', 'mujoco', 'numpy')


def versions() -> dict[str, str | None]:
    """Returns the versions of Python and of the packages that decide on a trajectory."""
    found: dict[str, str | None] = {'python': platform.python_version()}
    for name in _DISTRIBUTIONS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:  # Run from a clone.
            found[name] = None
    return found


def code_digest() -> str:
    """Returns a digest of this package's code, models and policies, which decide on episodes."""
    root = pathlib.Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted(root.rglob('*')):
        if path.suffix in ('.py', '.xml', '.json', '.onnx') and path.is_file():
            digest.update(path.relative_to(root).as_posix().encode() + b'\0')
            digest.update(path.read_bytes() + b'\0')
    return digest.hexdigest()
