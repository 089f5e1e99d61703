"""Makes `fetch_looks.npz` from `fetch_looks.xml`: `python -m fetch_composer.entities.make_looks`.

Each body's shapes become one mesh. Faces that other shapes of the body hide are left out. A body
has one material, of the brightest colour of its shapes, and a palette darkens it to each of them.
"""

import os
import struct
import zlib
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fetch_composer.entities import looks

_DIRECTORY = os.path.dirname(__file__)
_SIDES = 28  # Of a cylinder, as MuJoCo draws it.
_HIDDEN_DEPTH = 2e-4  # m, below the surface of another shape.
_SHARP = 0.8  # Cosine of a normal's angle to its face, below which MuJoCo draws the face flat.
# Colours of less of a body than this are brought out by making the material brighter, all its
# channels alike, so that highlights of the others keep their hue, but not by more than a factor.
_SMALL_SHARE = 0.01
_MOST_BRIGHTER = 1.5

# Looks of rigid parts that are one body where they cannot move: (model, parts), the first of which
# gives the frame.
_TOGETHER = {
    'torso': ('fetch_arm.xml', ('torso_lift_link', 'torso_fixed_link')),
    'closed_gripper': (
        'fetch_gripper.xml',
        ('gripper_link', 'r_gripper_finger_link', 'l_gripper_finger_link'),
    ),
}


class _Shape(NamedTuple):
    """A convex shape: three corners for each of its faces, with normals, in a body's frame."""

    corners: np.ndarray  # (n, 3, 3) m
    normals: np.ndarray  # (n, 3, 3)
    material: int

    def moved(self, position: np.ndarray, rotation: np.ndarray) -> '_Shape':
        return _Shape(
            self.corners @ rotation.T + position, self.normals @ rotation.T, self.material
        )

    def areas(self) -> np.ndarray:
        return np.linalg.norm(self._across(), axis=1) / 2

    def hides(self, points: np.ndarray) -> np.ndarray:
        """Returns which (..., 3) points lie well below the shape's surface."""
        across = self._across()
        kept = np.linalg.norm(across, axis=1) > 1e-12
        outward = across[kept] / np.linalg.norm(across[kept], axis=1, keepdims=True)
        offset = np.einsum('ni,ni->n', outward, self.corners[kept, 0])
        return (points @ outward.T < offset - _HIDDEN_DEPTH).all(-1)

    def _across(self) -> np.ndarray:
        a, b, c = self.corners.swapaxes(0, 1)
        return np.cross(b - a, c - a)


def _sharpened(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Returns normals with edges as sharp as MuJoCo draws them where there is no palette."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    sharp = np.einsum('ni,nki->nk', flat, normals) < _SHARP
    return np.where(sharp[..., np.newaxis], flat[:, np.newaxis], normals)


def _box(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners, normals = [], []
    for axis in range(3):
        for sign in (-1, 1):
            normal, u = np.zeros(3), np.zeros(3)
            normal[axis], u[(axis + 1) % 3] = sign, 1
            v = np.cross(normal, u)
            around = ((-1, -1), (1, -1), (1, 1), (-1, 1))
            a, b, c, d = ((normal + i * u + j * v) * size for i, j in around)
            corners += [(a, b, c), (a, c, d)]
            normals += [(normal,) * 3] * 2
    return np.array(corners), np.array(normals)


def _cylinder(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    radius, half_length = size[:2]
    angle = 2 * np.pi * np.arange(_SIDES + 1) / _SIDES
    rim = np.stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)), -1)
    up = np.array((0.0, 0.0, 1.0))
    bottom, top = radius * rim - half_length * up, radius * rim + half_length * up
    corners, normals = [], []
    for i in range(_SIDES):
        a, b, c, d = bottom[i], bottom[i + 1], top[i + 1], top[i]
        corners += [(a, b, c), (a, c, d)]
        normals += [(rim[i], rim[i + 1], rim[i + 1]), (rim[i], rim[i + 1], rim[i])]
        corners += [(half_length * up, d, c), (-half_length * up, b, a)]
        normals += [(up,) * 3, (-up,) * 3]
    return np.array(corners), np.array(normals)


def _shape(model: mujoco.MjModel, geom: int) -> _Shape:
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        rows = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[rows]]
        normals = model.mesh_normal[model.mesh_normaladr[mesh] + model.mesh_facenormal[rows]]
        normals = _sharpened(corners, normals)
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners, normals = _box(size)
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        corners, normals = _cylinder(size)
    else:
        raise ValueError(f'No mesh is made for geoms of type {mujoco.mjtGeom(kind).name}.')
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    shape = _Shape(corners, normals, int(model.geom_matid[geom]))
    return shape.moved(model.geom_pos[geom], rotation.reshape(3, 3))


def _visible(shapes: list[_Shape]) -> list[_Shape]:
    """Returns the shapes without faces that others hide."""
    seen = []
    for shape in shapes:
        hidden = np.zeros(len(shape.corners), bool)
        for other in shapes:
            if other is not shape:
                hidden |= other.hides(shape.corners).all(1)
        hidden |= shape.areas() < 1e-10
        seen.append(_Shape(shape.corners[~hidden], shape.normals[~hidden], shape.material))
    return [shape for shape in seen if len(shape.corners)]


def _shapes() -> dict[str, list[_Shape]]:
    model = mujoco.MjModel.from_xml_path(os.path.join(_DIRECTORY, 'fetch_looks.xml'))
    made: dict[str, list[_Shape]] = {}
    for geom in range(model.ngeom):
        name = model.body(model.geom_bodyid[geom]).name
        made.setdefault(name, []).append(_shape(model, geom))
    for name, (file, parts) in _TOGETHER.items():
        robot = mujoco.MjModel.from_xml_path(os.path.join(_DIRECTORY, file))
        data = mujoco.MjData(robot)
        mujoco.mj_kinematics(robot, data)
        made[name] = []
        frame = data.body(parts[0])
        turn = frame.xmat.reshape(3, 3)
        for part in parts:
            body = data.body(part)
            position = (body.xpos - frame.xpos) @ turn
            rotation = turn.T @ body.xmat.reshape(3, 3)
            made[name] += [shape.moved(position, rotation) for shape in made[part]]
    return {name: _visible(shapes) for name, shapes in made.items()}


def _png(texels: np.ndarray) -> bytes:
    """Returns a picture of one row, of (n, 3) colours of 8 bits."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        checksum = zlib.crc32(kind + data)
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', checksum)

    size = struct.pack('>IIBBBBB', len(texels), 1, 8, 2, 0, 0, 0)
    row = zlib.compress(b'\0' + texels.astype(np.uint8).tobytes())
    return b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', size) + chunk(b'IDAT', row) + chunk(b'IEND', b'')


def make() -> dict[str, Any]:
    """Returns the arrays of `fetch_looks.npz`."""
    model = mujoco.MjModel.from_xml_path(os.path.join(_DIRECTORY, 'fetch_looks.xml'))
    rows: dict[str, list] = {
        key: []
        for key in ('vertices', 'normals', 'texels', 'faces', 'names')
        + ('num_vertices', 'num_faces', 'rgba', 'specular', 'shininess')
    }
    colours: list[np.ndarray] = []
    for name, shapes in _shapes().items():
        materials = list(dict.fromkeys(shape.material for shape in shapes))
        share = np.array(
            [sum(s.areas().sum() for s in shapes if s.material == each) for each in materials]
        )
        share /= share.sum()
        rgb = model.mat_rgba[materials][:, :3].astype(float)
        brightest = rgb[share > _SMALL_SHARE].max(0)
        brightest = brightest * min(_MOST_BRIGHTER, (rgb / brightest).max())
        palette = np.minimum(rgb / brightest, 1)
        # The palette darkens highlights as well.
        darkness = palette.mean(1)
        specular = share @ (model.mat_specular[materials] * darkness) / (share @ darkness**2)
        first = len(colours)
        colours += list(np.round(255 * palette))
        rows['names'].append(name)
        rows['rgba'].append((*brightest, 1))
        rows['specular'].append(min(specular, 1.0))
        rows['shininess'].append(share @ model.mat_shininess[materials])

        corners = np.concatenate([shape.corners for shape in shapes]).reshape(-1, 3)
        normals = np.concatenate([shape.normals for shape in shapes]).reshape(-1, 3)
        texels = np.concatenate(
            [np.full(3 * len(s.corners), first + materials.index(s.material)) for s in shapes]
        )
        points = np.round(corners / looks.UNIT)
        directions = np.round(looks.NORMAL_LENGTH * normals)
        columns = np.column_stack((points, directions, texels)).astype(int)
        unique, faces = np.unique(columns, axis=0, return_inverse=True)
        faces = faces.reshape(-1, 3)
        # Rounding may have made corners one.
        faces = faces[[len({tuple(p) for p in unique[face, :3]}) == 3 for face in faces]]
        rows['vertices'] += list(unique[:, :3])
        rows['normals'] += list(unique[:, 3:6])
        rows['texels'] += list(unique[:, 6])
        rows['faces'] += list(faces)
        rows['num_vertices'].append(len(unique))
        rows['num_faces'].append(len(faces))
    kinds = {
        'vertices': np.int16,
        'normals': np.int16,
        'texels': np.uint8,
        'faces': np.uint16,
    }
    made = {key: np.array(value, kinds.get(key)) for key, value in rows.items()}
    made['num_texels'] = np.array(len(colours))
    made['palette'] = np.frombuffer(_png(np.array(colours)), np.uint8)
    return made


if __name__ == '__main__':
    np.savez_compressed(looks.DATA, **make())
