"""Making rigid parts of a model one body, since MuJoCo takes time for each."""

import mujoco
import numpy as np
from dm_control import mjcf

_ROTATIONS = ('quat', 'euler', 'axisangle', 'xyaxes', 'zaxis')


def fuse(body: mjcf.Element) -> None:
    """Makes a body without joints and children, not rotated in its parent, a part of it.

    Its geoms keep their names, and its mass and inertia are added to the parent's.

    Raises:
        ValueError: if the body has joints or bodies of its own, or is rotated.
    """
    parts = body.find_all('joint', immediate_children_only=True)
    if parts or body.body or any(getattr(body, name) is not None for name in _ROTATIONS):
        raise ValueError(f'{body.name!r} is no rigid leaf that is aligned with its parent.')
    parent = body.parent
    offset = np.zeros(3) if body.pos is None else np.array(body.pos)
    _add_inertia(parent.inertial, body.inertial, offset)
    geoms = [dict(geom.get_attributes()) for geom in body.geom]
    body.remove()
    for attributes in geoms:
        if 'fromto' in attributes:
            attributes['fromto'] = np.add(attributes['fromto'], np.tile(offset, 2))
        else:
            attributes['pos'] = np.add(attributes.get('pos', 0), offset)
        parent.add('geom', **attributes)


# Of the elements of a symmetric matrix, in MuJoCo's order.
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def _inertia(inertial: mjcf.Element) -> np.ndarray:
    """Returns (3, 3) inertia in kg m² about the centre of mass, in the body's axes."""
    if inertial.fullinertia is not None:
        matrix = np.zeros((3, 3))
        matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = inertial.fullinertia
        return matrix
    axes = np.zeros(9)
    quaternion = (1.0, 0.0, 0.0, 0.0) if inertial.quat is None else inertial.quat
    mujoco.mju_quat2Mat(axes, np.array(quaternion, dtype=np.float64))
    rotation = axes.reshape(3, 3)
    return rotation @ np.diag(inertial.diaginertia) @ rotation.T


def _displaced(inertia: np.ndarray, mass: float, displacement: np.ndarray) -> np.ndarray:
    """Returns the inertia about a point displaced from the centre of mass, by Steiner."""
    square = displacement @ displacement * np.eye(3)
    return inertia + mass * (square - np.outer(displacement, displacement))


def _add_inertia(inertial: mjcf.Element, added: mjcf.Element, offset: np.ndarray) -> None:
    centre, added_centre = np.array(inertial.pos), np.array(added.pos) + offset
    mass = inertial.mass + added.mass
    common = (inertial.mass * centre + added.mass * added_centre) / mass
    total = _displaced(_inertia(inertial), inertial.mass, centre - common)
    total += _displaced(_inertia(added), added.mass, added_centre - common)
    inertial.quat = inertial.diaginertia = None
    inertial.pos, inertial.mass = common, mass
    inertial.fullinertia = total[_ROWS, _COLUMNS]
