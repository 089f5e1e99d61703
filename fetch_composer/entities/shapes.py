"""The shapes that an object may have, by name, with the sizes that are the default."""

import os

import numpy as np
import numpy.typing as npt

from fetch_composer.entities import mesh_solids, solids

_PRIMITIVES: dict[str, type[solids.Solid]] = {
    each.shape: each for each in (solids.Box, solids.Cylinder, solids.Capsule, solids.Ellipsoid)
}
MESH = mesh_solids.Mesh.shape
_ALL: dict[str, type[solids.Solid]] = {**_PRIMITIVES, MESH: mesh_solids.Mesh}
NAMES = tuple(_ALL)

# In m, as MuJoCo has them: as wide as the gripper grasps a block. Of a mesh, half of the largest
# side of its bounding box.
DEFAULT_SIZES = {
    'box': (0.025, 0.025, 0.025),
    'cylinder': (0.025, 0.025),
    'capsule': (0.025, 0.02),
    'ellipsoid': (0.03, 0.025, 0.02),
    'mesh': (0.025,),
}
SMALLEST, LARGEST = 0.005, 0.1  # m, of a size that may be chosen.


def num_sizes(shape: str) -> int:
    """Returns how many sizes a shape has."""
    return _ALL[shape].num_sizes


def make(shape: str, size: npt.ArrayLike | None = None) -> solids.Solid:
    """Returns a solid that is no mesh.

    Args:
        shape: One of `NAMES`, but that of a mesh.
        size: Its sizes in m, as MuJoCo has them, or one for all; None for the default.

    Raises:
        ValueError: if there is no such shape, or it has another number of sizes.
    """
    if shape not in _PRIMITIVES:
        raise ValueError(
            f'Unknown geom_type {shape!r}; valid are {", ".join(_PRIMITIVES)}, and {MESH} with a '
            'file.'
        )
    sizes, needed = _sizes(shape, size), num_sizes(shape)
    return _PRIMITIVES[shape](np.broadcast_to(sizes, needed))


def mesh(path: str | os.PathLike, size: npt.ArrayLike | None = None) -> mesh_solids.Mesh:
    """Returns the solid in a file.

    Args:
        path: An .obj or .stl file.
        size: Half of its bounding box in m, or of the largest side of that; None for the default.

    Raises:
        ValueError: if it has another number of sizes, or the file holds no solid.
    """
    return mesh_solids.Mesh(path, _sizes(MESH, size))


def _sizes(shape: str, size: npt.ArrayLike | None) -> np.ndarray:
    sizes = np.array(DEFAULT_SIZES[shape] if size is None else size, dtype=np.float64).reshape(-1)
    if sizes.size not in (1, num_sizes(shape)):
        raise ValueError(
            f'{sizes.tolist()} are not the sizes of a {shape}: it has {num_sizes(shape)}.'
        )
    return sizes
