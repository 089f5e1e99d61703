"""What can be seen of a model, as triangles in one colour each."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import trimesh
from dm_control.mujoco.wrapper import mjbindings

_VISIBLE_GROUPS = 3  # Of geoms and sites; those of higher groups are not drawn.
_FLOOR_SIZE = 2.0  # m: half of what is shown of a plane, which has no end.
_SECTIONS = 24  # Of what is round.


@dataclasses.dataclass(frozen=True)
class Solid:
    """Triangles that belong to a body.

    Attributes:
        body: Index of the body.
        name: Name of the geom or site.
        vertices: (n, 3) in m, in the body's frame. Where an edge is sharp, each side has its own.
        faces: (m, 3) indices of vertices.
        rgba: (4,) colour in [0, 1].
    """

    body: int
    name: str
    vertices: np.ndarray
    faces: np.ndarray
    rgba: np.ndarray


def of_model(model: Any) -> Iterator[Solid]:
    """Yields the solids of a model, as dm_control wraps it."""
    for kind in ('geom', 'site'):
        bodies, groups, types, sizes, places, turns, materials, rgbas = (
            getattr(model, f'{kind}_{field}')
            for field in ('bodyid', 'group', 'type', 'size', 'pos', 'quat', 'matid', 'rgba')
        )
        for index in range(len(bodies)):
            material = materials[index]
            rgba = rgbas[index] if material < 0 else model.mat_rgba[material]
            if groups[index] >= _VISIBLE_GROUPS or not rgba[3]:
                continue
            shape = mujoco.mjtGeom(int(types[index]))
            parts = (
                _of_mesh(model, model.geom_dataid[index], material, rgba)
                if shape == mujoco.mjtGeom.mjGEOM_MESH
                else [_primitive(shape, sizes[index], _whole(model, material, rgba))]
            )
            turn = np.empty(9)
            mjbindings.mjlib.mju_quat2Mat(turn, turns[index])
            for vertices, faces, colour in parts:
                placed = vertices @ turn.reshape(3, 3).T + places[index]
                yield Solid(int(bodies[index]), model.id2name(index, kind), placed, faces, colour)


def _primitive(shape: mujoco.mjtGeom, size: np.ndarray, rgba: np.ndarray) -> tuple[np.ndarray, ...]:
    """Returns vertices, faces and colour of a geom or site that is no mesh."""
    shapes, creation = mujoco.mjtGeom, trimesh.creation
    if shape == shapes.mjGEOM_PLANE:
        extent = [2 * (each or _FLOOR_SIZE) for each in np.minimum(size[:2], _FLOOR_SIZE)]
        made = creation.box((*extent, 1e-3))
        made.apply_translation((0, 0, -5e-4))
    elif shape == shapes.mjGEOM_SPHERE:
        made = creation.icosphere(3, size[0])
    elif shape == shapes.mjGEOM_ELLIPSOID:
        made = creation.icosphere(3)
        made.apply_scale(size)
    elif shape == shapes.mjGEOM_CAPSULE:
        made = creation.capsule(2 * size[1], size[0], [_SECTIONS, _SECTIONS])
        made.apply_translation((0, 0, -made.bounds.mean(axis=0)[2]))
    elif shape == shapes.mjGEOM_CYLINDER:
        made = creation.cylinder(size[0], 2 * size[1], _SECTIONS)
    else:
        made = creation.box(2 * size)
    vertices, faces = np.asarray(made.vertices), np.asarray(made.faces)
    if shape in (shapes.mjGEOM_PLANE, shapes.mjGEOM_BOX, shapes.mjGEOM_CYLINDER):
        vertices = vertices[faces].reshape(-1, 3)  # Their edges are sharp.
        faces = np.arange(len(vertices)).reshape(-1, 3)
    return vertices, faces, rgba


def _of_mesh(
    model: Any, mesh: int, material: int, rgba: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yields vertices, faces and colour of the parts of a mesh, one for each of its colours."""

    def rows(name: str, of: str) -> np.ndarray:
        start, count = (getattr(model, f'mesh_{of}{each}')[mesh] for each in ('adr', 'num'))
        return getattr(model, f'mesh_{name}')[start : start + count]

    faces, normals, vertices = (
        rows('face', 'face'),
        rows('facenormal', 'face'),
        rows('vert', 'vert'),
    )
    count = len(faces)
    texture = _texture(model, material)
    if texture is None or not model.mesh_texcoordnum[mesh]:
        colours = np.tile(rgba, (count, 1))
    else:
        corner = rows('texcoord', 'texcoord')[rows('facetexcoord', 'face')[:, 0]]
        height, width = texture.shape[:2]
        row, column = (
            np.clip((corner[:, axis] * size).astype(int), 0, size - 1)
            for axis, size in ((1, height), (0, width))
        )
        colours = rgba * np.column_stack((texture[row, column] / 255, np.ones(count)))
    for colour in np.unique(colours, axis=0):
        chosen = (colours == colour).all(axis=1)
        corners = np.stack((faces[chosen], normals[chosen]), axis=-1).reshape(-1, 2)
        used, index = np.unique(corners, axis=0, return_inverse=True)
        yield vertices[used[:, 0]], index.reshape(-1, 3), colour


def _texture(model: Any, material: int) -> np.ndarray | None:
    """Returns the picture on a material, (height, width, 3) uint8; None if it has none."""
    if material < 0:
        return None
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture < 0:
        return None
    shape = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    start = model.tex_adr[texture]
    return model.tex_data[start : start + int(np.prod(shape))].reshape(shape)[..., :3]


def _whole(model: Any, material: int, rgba: np.ndarray) -> np.ndarray:
    """Returns one colour for a material, the mean of what it shows."""
    texture = _texture(model, material)
    if texture is None:
        return rgba
    return rgba * np.append(texture.mean(axis=(0, 1)) / 255, 1)
