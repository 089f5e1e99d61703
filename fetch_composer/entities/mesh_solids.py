"""Solids of a user's own shape, read from a file."""

import contextlib
import os
import pathlib
from collections.abc import Iterator

import mujoco
import numpy as np
import numpy.typing as npt

from fetch_composer.entities import solids

SUFFIXES = ('.obj', '.stl')


class Mesh(solids.Solid):
    """What is in a file, scaled. It stands as it does there, with z up.

    MuJoCo collides, and weighs, a mesh's convex hull.

    Attributes:
        path: The file.
        attributes: What MJCF needs to know of the mesh, beside its name.
    """

    shape, num_sizes = 'mesh', 3

    def __init__(self, path: str | os.PathLike, size: npt.ArrayLike) -> None:
        """Reads a mesh.

        Args:
            path: An .obj or .stl file.
            size: (3,) half of its bounding box in m; one number for the largest of the three, with
                the proportions that it has.

        Raises:
            ValueError: if there is no such file, or no solid in it; the message names the file.
        """
        if not isinstance(path, (str, os.PathLike)) or pathlib.Path(path).suffix.lower() not in (
            SUFFIXES
        ):
            raise ValueError(
                f'object_mesh must be the path of an {" or ".join(SUFFIXES)} file; '
                f'got {path!r:.200}.'
            )
        self.path = os.path.abspath(path)
        with self._explaining():
            lower, upper = self._extent()
            half = (upper - lower) / 2
            size = np.array(size, dtype=np.float64)
            super().__init__(size if size.size == 3 else size / half.max() * half)
            self.attributes = {
                'file': self.path,
                'refpos': (lower + upper) / 2,
                'scale': self.size / half,
                'inertia': 'convex',
            }
            self._model = model = self._compiled(**self.attributes)
        self._pose = model.geom_pos[0].copy(), model.geom_quat[0].copy()
        self._moments = model.body_inertia[1].copy()  # Of 1 kg.

    @contextlib.contextmanager
    def _explaining(self) -> Iterator[None]:
        """Says which file it is that MuJoCo makes nothing of."""
        try:
            yield
        except (ValueError, OverflowError) as error:
            reason = str(error).removeprefix('Error: ').partition('\n')[0]
            raise ValueError(f'object_mesh {self.path} is no solid: {reason}.') from None

    def _compiled(self, **attributes) -> mujoco.MjModel:
        """Returns a model of one body of 1 kg."""
        spec = mujoco.MjSpec()
        attributes['inertia'] = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.add_mesh(name='mesh', **attributes)
        spec.worldbody.add_body().add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname='mesh', mass=1.0
        )
        return spec.compile()

    def _extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns the lowest and the highest corner of the bounding box in the file."""
        model = self._compiled(file=self.path)
        corners = np.array(
            [solids.rotated(each, model.mesh_quat[0]) for each in model.mesh_vert.astype(float)]
        )
        corners += model.mesh_pos[0]
        return corners.min(axis=0), corners.max(axis=0)

    def moments(self, mass: float) -> np.ndarray:
        return mass * self._moments

    @property
    def bounds(self) -> np.ndarray:
        return self.size

    @property
    def radius(self) -> float:
        return float(self._model.geom_rbound[0])

    @property
    def is_round(self) -> bool:
        return False

    @property
    def geom_size(self) -> np.ndarray:
        return self._model.geom_size[0]

    @property
    def geom_pose(self) -> tuple[np.ndarray, np.ndarray]:
        return self._pose

    @property
    def geom_aabb(self) -> np.ndarray:
        return self._model.geom_aabb[0]
