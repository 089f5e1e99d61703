"""What the Fetch looks like: one mesh for each of its bodies, coloured by a palette.

MuJoCo takes time for each geom of a body, also for those that can only be seen. The shapes are
those of `fetch_looks.xml`; `make_looks.py` makes the meshes.
"""

import dataclasses
import functools
import os
from collections.abc import Mapping

import numpy as np
from dm_control import mjcf

DATA = os.path.join(os.path.dirname(__file__), 'fetch_looks.npz')
UNIT = 2e-5  # m, of which the file's vertices are multiples.
NORMAL_LENGTH = 32767  # Of the file's normals.


@dataclasses.dataclass(frozen=True)
class Look:
    """What one body looks like.

    Attributes:
        mesh: Vertices, normals, texture coordinates and faces, in MuJoCo's MSH format.
        rgba: Its colour, which the palette's colours are multiplied with.
        specular: How bright highlights are.
        shininess: How small highlights are.
        palette: The picture of all palettes, or None for what has one colour.
    """

    mesh: mjcf.Asset
    rgba: np.ndarray
    specular: float
    shininess: float
    palette: mjcf.Asset | None


@functools.cache
def looks() -> dict[str, Look]:
    """Returns the look of each body by its name, and of bodies that are worn together."""
    with np.load(DATA) as file:
        data = dict(file)
    vertices = data['vertices'].astype(np.float32) * np.float32(UNIT)
    normals = data['normals'].astype(np.float32) / np.float32(NORMAL_LENGTH)
    texcoords = np.full((len(vertices), 2), 0.5, np.float32)
    texcoords[:, 0] = (data['texels'] + 0.5) / data['num_texels']
    faces = data['faces'].astype(np.int32)
    palette = mjcf.Asset(data['palette'].tobytes(), '.png')
    made, vertex, face = {}, 0, 0
    for i, name in enumerate(data['names']):
        end, face_end = vertex + data['num_vertices'][i], face + data['num_faces'][i]
        rows = slice(vertex, end)
        count = end - vertex
        several = np.ptp(data['texels'][rows]) > 0
        mesh = (
            np.array((count, count, count if several else 0, face_end - face), np.int32),
            vertices[rows],
            normals[rows],
            texcoords[rows] if several else texcoords[:0],
            faces[face:face_end],
        )
        contents = b''.join(part.tobytes() for part in mesh)
        made[str(name)] = Look(
            mesh=mjcf.Asset(contents, '.msh'),
            rgba=data['rgba'][i],
            specular=float(data['specular'][i]),
            shininess=float(data['shininess'][i]),
            palette=palette if several else None,
        )
        vertex, face = end, face_end
    return made


def dress(root: mjcf.RootElement, together: Mapping[str, str] | None = None) -> None:
    """Gives each body of a model the look of its name, as one geom that does not collide.

    Args:
        root: The model, which has a default class 'visual'.
        together: Names of looks that some bodies have in place of their own.
    """
    together = together or {}
    visual = root.find('default', 'visual')
    texture = None
    for body in root.find_all('body'):
        look = looks().get(together.get(body.name, body.name))
        if look is None:
            continue
        material = root.asset.add(
            'material',
            name=body.name,
            rgba=look.rgba,
            specular=look.specular,
            shininess=look.shininess,
        )
        if look.palette is not None:
            texture = texture or root.asset.add(
                'texture', name='palette', type='2d', file=look.palette
            )
            material.texture = texture
        # The link's hull may be a mesh of the link's name.
        mesh = root.asset.add('mesh', name=f'{body.name}_look', file=look.mesh, inertia='shell')
        body.add(
            'geom',
            name=f'{body.name}_visual',
            dclass=visual,
            type='mesh',
            mesh=mesh,
            material=material,
        )
