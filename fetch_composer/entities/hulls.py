"""Convex hulls of those links of the Fetch that touch things, built from measured dimensions.

The dimensions were measured on the links of Gymnasium-Robotics 1.4.2, whose contacts they are to
reproduce; the shapes are built from them here.

Every hull is given in the frame of its link, in m. A link of the arm is the hull of two turned
parts, one about the axis of its roll and one about the axis of its bend; its ends are bevelled.
The trunk is the hull of outlines at several heights.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

# Rim of a bent joint's housing: (inset from its face along the axis, inset from its radius).
_HOUSING_RIM = ((0.0125, 0.0), (0.0077, 0.0023), (0.0017, 0.0049), (0.0008, 0.0056),
                (0.0002, 0.0065), (0.0, 0.0076))  # fmt: skip
# The same where an arm's segment ends.
_COLLAR_RIM = ((0.0025, 0.0), (0.002, 0.0005), (0.0, 0.0035))


def _turned(
    axis: str,
    profile: Sequence[tuple[float, float]],
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    sides: int = 60,
) -> np.ndarray:
    """Returns (n, 3) points of a body turned about a line parallel to `axis` through `centre`.

    Args:
        axis: 'x' or 'y'.
        profile: (Position along the axis, radius) of each of its rings.
        centre: A point of the line.
        sides: Of each ring, the first two of which meet on the x axis or, about x, the y axis.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    points = []
    for along, radius in profile:
        across = (radius * np.cos(angle), radius * np.sin(angle))
        level = np.full(sides, along)
        ring = (level, *across) if axis == 'x' else (across[0], level, across[1])
        points.append(np.stack(ring, axis=1))
    return np.concatenate(points) + np.array(centre)


def _rim(face: float, radius: float, rim: Sequence[tuple[float, float]]):
    """Returns the profile of a bevelled end whose face is at `face`, on the side of its sign."""
    return tuple((face - np.sign(face) * along, radius - inset) for along, inset in rim)


def _mirrored(level: float, half: npt.ArrayLike, axis: str = 'z') -> np.ndarray:
    """Returns (n, 3) points of an outline that is symmetric in y.

    Args:
        level: Where it cuts `axis`.
        half: Its half with y >= 0: (x, y) if it cuts z, (y, z) if it cuts x.
        axis: 'x' or 'z'.
    """
    points = np.array(half)
    levels = np.full(len(points), level)
    right = np.column_stack((points, levels) if axis == 'z' else (levels, points))
    return np.concatenate((right, right * (1, -1, 1)))


def _shoulder_lift() -> np.ndarray:
    collar = _turned('x', ((0.12, 0.052), *_rim(0.172, 0.052, _COLLAR_RIM)[:2], (0.172, 0.0475)))
    housing = ((-0.001, 0.0595), (-0.0005, 0.06), *_rim(0.0705, 0.06, _HOUSING_RIM))
    return np.concatenate((collar, _turned('y', housing, sides=30)))


def _upperarm_roll() -> np.ndarray:
    # Away from the housing, the barrel runs on in finer steps.
    lip = np.concatenate((
        _turned('x', ((-0.0015, 0.052),), sides=30),
        _turned('x', ((0.001248, 0.052), (0.00513, 0.051489)), sides=60),
    ))  # fmt: skip
    bend = (0.133, 0.0, 0.0)
    shell = np.concatenate((
        _turned('y', ((0.0, 0.0515), (-0.0005, 0.052)), bend, sides=30),
        _turned('y', ((-0.058, 0.052), (-0.05825, 0.051933)), bend),
        _turned('y', ((-0.06313, 0.04971),), bend, sides=78),
    ))  # fmt: skip
    end = _turned('y', ((-0.068768, 0.047098), (-0.069682, 0.046438), (-0.070288, 0.045487),
                        (-0.0705, 0.044379)), bend, sides=76)  # fmt: skip
    barrel = _turned('x', ((-0.048, 0.052),), sides=38)
    # The halves that face one another lie within.
    return np.concatenate((barrel, lip[lip[:, 1] > -1e-9], shell[shell[:, 0] > 0.1272], end))


def _elbow_flex() -> np.ndarray:
    collar = ((0.1106, 0.052), *_rim(0.166, 0.052, _COLLAR_RIM))
    housing = ((0.0015, 0.0517), (0.002, 0.052), *_rim(0.0705, 0.052, _HOUSING_RIM))
    return np.concatenate((_turned('x', collar, sides=58), _turned('y', housing, sides=30)))


def _forearm_roll() -> np.ndarray:
    collar = ((-0.032, 0.052), (-0.003, 0.052), (0.0058, 0.0515), (0.0091, 0.0502))
    housing = ((-0.0535, 0.0517), (-0.054, 0.052), *_rim(-0.087, 0.052, _HOUSING_RIM))
    return np.concatenate(
        (_turned('x', collar, sides=38), _turned('y', housing, (0.1245, 0, 0), sides=62))
    )


def _wrist_flex() -> np.ndarray:
    collar = _turned('x', ((0.06, 0.052), *_rim(0.1165, 0.052, _COLLAR_RIM)), sides=32)
    housing = ((-0.054, 0.05), (-0.0525, 0.0515), (-0.052, 0.052),
               *_rim(0.067, 0.052, _HOUSING_RIM))  # fmt: skip
    return np.concatenate((collar, _turned('y', housing, sides=62)))


def _wrist_roll() -> np.ndarray:
    profile = ((-0.023, 0.052), (0.005, 0.052), (0.0077, 0.0512), (0.0081, 0.0509),
               (0.0195, 0.03075))  # fmt: skip
    return _turned('x', profile, sides=38)


def _arc(centre, radii, start: float, stop: float, steps: int) -> np.ndarray:
    """Returns (steps + 1, 2) points of an ellipse's arc between two angles in degrees."""
    angle = np.radians(np.linspace(start, stop, steps + 1))
    return np.array(centre) + np.column_stack((np.cos(angle), np.sin(angle))) * radii


def _palm() -> np.ndarray:
    low_corner, low_radius = (0.0525514, -0.0245), 0.0095
    high_corner, high_radius = (0.0488, 0.0264), 0.0132
    ridge = 0.0008  # Height at which the palm is widest.
    belly_depth, belly_radius, belly_angle = 0.0398584, 0.177, 7.194  # An arc below the wrist.

    def outline(inset: float) -> np.ndarray:
        insets = np.array((1.1 * inset, inset))
        return np.concatenate((
            _arc(low_corner, low_radius - insets, -90, 0, 6),
            ((0.063 - 0.97 * inset, ridge),),
            _arc(high_corner, high_radius - insets, 0, 90, 6),
        ))  # fmt: skip

    # Towards the fingers. Below: (x where lowest, radii of the corner, slope of x over z). Above:
    # (x, inset of the outline).
    nose_below = ((-0.0473512, (0.0095, 0.0095), 0.0036), (-0.045761, (0.00914, 0.009171), 0.0036),
                  (-0.035301, (0.0043, 0.00464), 0.03), (-0.034065, (0.00353, 0.0038), 0.031),
                  (-0.033223, (0.00226, 0.002566), 0.034),
                  (-0.032893, (0.00078, 0.001109), 0.035))  # fmt: skip
    nose_above = ((-0.04735, 0.0), (-0.04576, 0.0003), (-0.0355, 0.0049), (-0.0343, 0.0056),
                  (-0.0334, 0.007), (-0.0331, 0.0084))  # fmt: skip
    # Towards the wrist: besides, the belly rises by so much.
    heel = ((-0.1395091, 0.0, 0.0), (-0.1488, 0.0044, 0.0002), (-0.1507, 0.0051, 0.0006),
            (-0.1522, 0.0063, 0.002))  # fmt: skip
    belly_centre = (0, belly_radius - belly_depth)
    belly = _arc(belly_centre, belly_radius, -90, belly_angle - 90, 3)
    crown = _arc((0, 0.0396 - 0.17), 0.17, 90, 90 - 6, 2)
    points = []
    for x, radii, slope in nose_below:
        half = _arc(low_corner, radii, -90, 0, 12)
        corner = _mirrored(x, half, 'x')
        corner[:, 0] += slope * (corner[:, 2] - corner[0, 2])
        points.append(corner)
    for x, inset in nose_above:
        half = outline(inset)
        points.append(_mirrored(x, half[half[:, 1] >= ridge], 'x'))
    for x, inset, rise in heel:
        points.append(_mirrored(x, outline(inset), 'x'))
        points.append(_mirrored(x, belly + (0, rise), 'x'))
        points.append(_mirrored(x, crown - (0, rise), 'x'))
    # The belly's rim is bevelled in its middle; both ends of the palm are slightly convex.
    bevel = _arc(belly_centre, belly_radius - 0.000222, -90, belly_angle - 90, 3)
    points.append(_mirrored(-0.1338601, bevel[:2], 'x'))
    points.append(_mirrored(-0.0320, ((0.0, 0.0008), (0.0545, 0.0008)), 'x'))
    points.append(_mirrored(-0.1540, ((0.054, -0.0008), (0.0542, 0.0008)), 'x'))
    return np.concatenate(points)


def _base() -> np.ndarray:
    front = np.radians(np.linspace(0, 57.6, 14))
    rear = np.radians(np.linspace(120.5, 180, 15))
    outline = np.concatenate((
        0.2864 * np.column_stack((np.cos(front), np.sin(front))),
        ((0.1166, 0.2578), (0.0924, 0.2618), (0.0225, 0.264), (-0.0746, 0.2628),
         (-0.1175, 0.2579)),
        0.2872 * np.column_stack((np.cos(rear), np.sin(rear))),
    ))  # fmt: skip
    # From 0.3 m up, the rear flanks are flat.
    cut = np.concatenate((
        outline[(outline[:, 0] > 0.02) | (outline[:, 0] < -0.225)],
        ((-0.2266, 0.1768), (-0.2165, 0.1867), (-0.2049, 0.1929), (-0.009, 0.263),
         (0.0051, 0.2641)),
    ))  # fmt: skip
    # (Height, inset along x, inset along y, outline).
    levels = ((0.0381, 0.0046, 0.0058, outline), (0.064, 0.0013, 0.0029, outline),
              (0.1, 0.0003, 0.0016, outline), (0.15, 0.0, 0.0005, outline),
              (0.22, 0.0, 0.0, outline), (0.254, 0.0, 0.0, outline), (0.3153, 0.0, 0.0, cut),
              (0.335, 0.0009, 0.0014, cut), (0.3473, 0.0038, 0.0035, cut),
              (0.357, 0.008, 0.0085, cut), (0.3583, 0.0095, 0.0105, cut),
              (0.358885, 0.0204, 0.0214, cut))  # fmt: skip
    points = [_mirrored(1.18e-6, ((-0.2145, 0.1245), (0.17, 0.1245)))]
    for height, inset_x, inset_y, half in levels:
        points.append(_mirrored(height, half * (1 - inset_x / 0.2868, 1 - inset_y / 0.264)))
    points[-1][:, 2] -= 1e-4 * points[-1][:, 0]  # The deck slopes to the front.
    return np.concatenate(points)


def _torso_fixed() -> np.ndarray:
    half = ((-0.0321, 0.1554), (-0.1175, 0.1554), (-0.1274, 0.1528), (-0.135, 0.1459),
            (-0.1483, 0.1233), (-0.1593, 0.0995), (-0.1679, 0.0748), (-0.1683, 0.0724))  # fmt: skip
    return np.concatenate((_mirrored(-0.0156, half), _mirrored(0.4403, half),
                           _mirrored(-0.0186, ((-0.0351, 0.1554), *half[1:])),
                           _mirrored(0.4433, ((-0.0351, 0.1554), *half[1:]))))  # fmt: skip


def _torso_lift() -> np.ndarray:
    rear = ((-0.185, 0.025), (-0.183, 0.07), (-0.16, 0.128), (-0.14, 0.159), (-0.12, 0.167),
            (-0.019, 0.171))  # fmt: skip
    outlines = {
        0.0285: (*rear, (0.0, 0.17), (0.019, 0.151), (0.04, 0.105), (0.044, 0.091), (0.047, 0.0)),
        0.183: ((0.145, 0.046), (0.152, 0.036), (0.162, 0.0145), (0.1635, 0.0)),
        0.199: ((0.159, 0.034), (0.166, 0.023), (0.1705, 0.0105), (0.1716, 0.0)),
        0.3: ((0.1635, 0.0275), (0.1685, 0.018), (0.171, 0.008), (0.1716, 0.0)),
        0.46: rear,
        0.577: ((-0.154, 0.07), (-0.127, 0.131), (-0.105, 0.144), (-0.019, 0.148)),
        0.603: ((-0.055, 0.035), (-0.028, 0.086), (0.056, 0.08), (0.13, 0.02), (0.132, 0.0)),
    }  # fmt: skip
    # The corners of the two faces at the front that the shoulder meets.
    left = ((0.000339, 0.167973, 0.490486), (0.115184, 0.051653, 0.602999),
            (0.153396, 0.039455, 0.29958))  # fmt: skip
    right = ((-0.00073, -0.169346, 0.502487), (0.105566, -0.06009, 0.603),
             (0.157209, -0.035822, 0.299581))  # fmt: skip
    points = [_mirrored(z, half) for z, half in outlines.items()]
    return np.concatenate((*points, left, right))


def _around_y(radius: float, degrees: npt.ArrayLike, y, centre=(0.0, 0.0)) -> np.ndarray:
    """Returns (n, 3) points at angles, from x to z, about a line parallel to the y axis."""
    angle = np.radians(degrees)
    x, z = centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)
    return np.column_stack((x, np.broadcast_to(y, x.shape), z))


def _head_pan() -> np.ndarray:
    # The front is round about the axis on which the head tilts.
    axis, radius = (0.1425, 0.058), 0.055
    steps = np.arange(-90, 91, 7.5)
    points = []
    for y, inset in ((0.128208, 0.0), (0.130012, 0.000278), (0.13165, 0.001085)):
        points += [_around_y(radius - inset, steps, side * y, axis) for side in (1, -1)]
    # Within the front's width there is one more ring at each side, neither in step with the rest.
    for side, first in ((1, -90.0), (-1, -94.526)):
        ring = first + 15.8482 * np.arange(12)
        slant = 0.109155 - 0.000758 * np.cos(np.radians(ring))
        points.append(
            _around_y(radius, ring[np.abs(ring) < 85], side * slant[np.abs(ring) < 85], axis)
        )
    outlines = {
        -0.003: ((0.0727, 0.0128), (0.0678, 0.0293), (0.0475, 0.0565), (0.017, 0.0718),
                 (-0.017, 0.0718), (-0.0474, 0.0565), (-0.0678, 0.0292), (-0.0727, 0.0128)),
        0.003: ((0.0126, 0.1282), (-0.0086, 0.1246), (-0.0348, 0.1111), (-0.0744, 0.0813),
                (-0.0988, 0.0488), (-0.1098, 0.0096)),
        0.03: ((0.1719, 0.142), (0.0067, 0.1421), (-0.0183, 0.1363), (-0.056, 0.1139),
               (-0.0979, 0.077), (-0.1188, 0.0375), (-0.1239, 0.0128)),
        0.058: ((0.1866, 0.1424), (0.0341, 0.1429), (-0.0055, 0.1403), (-0.0439, 0.122),
                (-0.0898, 0.0859), (-0.1146, 0.0409), (-0.1193, 0.0013)),
        0.09: ((0.1742, 0.141), (0.0237, 0.1418), (-0.0016, 0.1399), (-0.0235, 0.1294),
               (-0.0371, 0.1118)),
        0.113: ((0.0526, 0.1282),),
    }  # fmt: skip
    return np.concatenate((*points, *(_mirrored(z, half) for z, half in outlines.items())))


def _head_tilt() -> np.ndarray:
    # The barrel's ends slant; towards the face its rings are out of step.
    steps = 11.7785 * np.arange(24)
    rim = (
        (0.0, 0.054965),
        (0.00076, 0.05482),
        (0.00141, 0.05439),
        (0.00184, 0.05375),
        (0.002, 0.053),
    )
    points = []
    for side, degrees in ((1, -steps), (-1, 3.6 - steps)):
        degrees = np.append(degrees[(degrees < 0) & (degrees > -270)], 0.0)
        for out, radius in rim:
            bulge = 0.000035 * (1 - np.cos(np.radians(degrees)))
            slant = 0.102999 - 0.000924 * np.cos(np.radians(degrees))
            points.append(_around_y(radius + bulge, degrees, side * (slant + out)))
    face = ((0.055, 0.037), (0.0487, 0.055), (0.0, 0.055))
    points.append(np.array([(x, y, z) for x, z in face for y in (0.102, -0.102)]))
    return np.concatenate(points)


TRUNK = ('base_link', 'torso_fixed_link', 'torso_lift_link')
HEAD = ('head_pan_link', 'head_tilt_link')
UPPER_ARM = ('upperarm_roll_link',)
ARM = (
    'shoulder_lift_link',
    'elbow_flex_link',
    'forearm_roll_link',
    'wrist_flex_link',
    'wrist_roll_link',
)
PALM = ('gripper_link',)

HULLS = {
    'base_link': _base(),
    'torso_fixed_link': _torso_fixed(),
    'torso_lift_link': _torso_lift(),
    'head_pan_link': _head_pan(),
    'head_tilt_link': _head_tilt(),
    'shoulder_lift_link': _shoulder_lift(),
    'upperarm_roll_link': _upperarm_roll(),
    'elbow_flex_link': _elbow_flex(),
    'forearm_roll_link': _forearm_roll(),
    'wrist_flex_link': _wrist_flex(),
    'wrist_roll_link': _wrist_roll(),
    'gripper_link': _palm(),
}
