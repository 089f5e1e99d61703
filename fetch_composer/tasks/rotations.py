"""Rotations of the gripper, as quaternions (w, x, y, z) of shape (..., 4).

They take sums, products and roots alone, which round alike for one gripper and for many.
"""

import numpy as np

_CONJUGATE = np.array((1.0, -1.0, -1.0, -1.0))
_SMALLEST = 1e-9  # Of a norm to divide by.


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Returns the rotation that is the second, followed by the first about axes of the world."""
    a, b, c, d = (first[..., i] for i in range(4))
    w, x, y, z = (second[..., i] for i in range(4))
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def turned(quaternion: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Returns rotations that are followed by small ones about axes of the world.

    Args:
        quaternion: The rotations.
        rotation: (..., 3) rotation vectors in rad, up to 0.2 long.
    """
    half = 0.5 * rotation
    square = _norm(half) ** 2
    # The sine of half the angle by its series, to within 1e-14; the cosine belongs to it.
    vector = half * (1 - square * (1 / 6 - square * (1 / 120 - square / 5040)))
    return product(_with_vector(vector), quaternion)


def held_near(quaternion: np.ndarray, other: np.ndarray, furthest: float, axes: int) -> np.ndarray:
    """Returns rotations that have been turned back where they were too far from others.

    Args:
        quaternion: The rotations.
        other: The other rotations.
        furthest: The largest angle between them in rad, less than pi.
        axes: How many of the world's axes may be turned about, of which z is the last; the angle
            is that about these axes.
    """
    # The angle between them is at least that about some axes, and is quickly found.
    may_be_far = np.abs(_sum(quaternion * other)) < np.cos(furthest / 2)
    if not may_be_far.any():
        return quaternion
    between = product(quaternion, other * _CONJUGATE)
    between[..., 1 : 4 - axes] = 0
    between = between / np.maximum(_norm(between), _SMALLEST)
    between = np.where(between[..., :1] < 0, -between, between)  # The same rotations, below pi.
    vector, most = between[..., 1:], np.sin(furthest / 2)
    size = _norm(vector)
    allowed = _with_vector(vector * (most / np.maximum(size, most)))
    back = product(allowed, between * _CONJUGATE)
    return np.where(may_be_far & (size > most), product(back, quaternion), quaternion)


def _with_vector(vector: np.ndarray) -> np.ndarray:
    """Returns the unit quaternions that have a vector part, (..., 3), and turn by less than pi."""
    return np.concatenate((np.sqrt(1 - _norm(vector) ** 2), vector), axis=-1)


def _norm(vector: np.ndarray) -> np.ndarray:
    """Returns (..., 1) norms."""
    return np.sqrt(_sum(vector * vector))


def _sum(terms: np.ndarray) -> np.ndarray:
    """Returns (..., 1) sums, added in order: NumPy's own sum adds as the shape suggests."""
    total = terms[..., :1]
    for i in range(1, terms.shape[-1]):
        total = total + terms[..., i : i + 1]
    return total
