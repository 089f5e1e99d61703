"""Explicit pairs of geoms in place of MuJoCo's search for those that may touch.

Without the search a substep takes 5 % less. Contacts are, to the bit and in their order, those
that it finds. But a pair keeps what it was given: it follows neither geoms that are added later,
nor their bits and coefficients when these are changed. So this is for a model that nobody else can
reach.
"""

import itertools
from collections.abc import Iterator

import mujoco
import numpy as np
from dm_control import mjcf

_MOST_PAIRS = 150  # The search costs as little from some 200 on; a push has 34.

# Which of a geom's sliding, torsional and rolling friction each coefficient of a pair is.
_COEFFICIENTS = (0, 0, 1, 2, 2)


def name(mjcf_model: mjcf.RootElement) -> bool:
    """Gives a model an explicit pair for every two geoms that may touch.

    Args:
        mjcf_model: The whole model, with everything attached.

    Returns:
        Whether it has. If there are so many that MuJoCo's search costs less, or flexible bodies,
        which have no pairs, nothing has changed. If it has, call `stop_search` on what is compiled.
    """
    physics = mjcf.Physics.from_mjcf_model(mjcf_model)
    geoms = mjcf_model.find_all('geom')
    by_id = dict(zip(physics.bind(geoms).element_id.tolist(), geoms, strict=True))
    model = physics.model.ptr
    pairs = list(_may_touch(model))
    if len(pairs) > _MOST_PAIRS or model.nflex:
        return False
    geom1, geom2 = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    attributes = {
        'friction': _friction(model, model.geom_friction, geom1, geom2),
        **_parameters(model, geom1, geom2),
    }
    for i, (one, other) in enumerate(pairs):
        values = {name: column[i] for name, column in attributes.items()}
        mjcf_model.contact.add('pair', geom1=by_id[one], geom2=by_id[other], **values)
    return True


def _may_touch(model: mujoco.MjModel) -> Iterator[tuple[int, int]]:
    """Yields what MuJoCo's search finds, in its order, by MuJoCo's rules."""
    weld = model.body_weldid
    weld_of_parent = weld[model.body_parentid[weld]]
    filters_parents = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    known = set(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
    excluded = set(model.exclude_signature.tolist())
    geoms = [np.flatnonzero(model.geom_bodyid == body).tolist() for body in range(model.nbody)]

    def are_kept_apart(one: int, other: int) -> bool:
        if weld[one] == weld[other] or (one << 16) + other in excluded:
            return True
        related = weld[one] == weld_of_parent[other] or weld[other] == weld_of_parent[one]
        return bool(filters_parents and related and weld[one] and weld[other])

    def have_bits(one: int, other: int) -> bool:
        bits, others = model.geom_contype, model.geom_conaffinity
        return bool(bits[one] & others[other] or bits[other] & others[one])

    def by_type(pair: tuple[int, int]) -> tuple[int, int]:
        one, other = pair
        return pair if model.geom_type[one] <= model.geom_type[other] else (other, one)

    for body1, body2 in itertools.combinations(range(model.nbody), 2):
        if are_kept_apart(body1, body2):
            continue
        for pair in sorted(map(by_type, itertools.product(geoms[body1], geoms[body2]))):
            if have_bits(*pair) and known.isdisjoint((pair, pair[::-1])):
                yield pair


def stop_search(model: mujoco.MjModel) -> None:
    """Makes MuJoCo test explicit pairs of geoms, and no others."""
    for bits in (
        model.geom_contype,
        model.geom_conaffinity,
        model.body_contype,
        model.body_conaffinity,
    ):
        bits[:] = 0


def friction(model: mujoco.MjModel, of_geoms: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Returns the friction that contacts of explicit pairs would have without them.

    Args:
        model: The compiled model.
        of_geoms: (number of geoms, 3) friction of its geoms.
        pairs: (n,) ids of pairs.

    Returns:
        (n, 5) coefficients.
    """
    return _friction(model, of_geoms, model.pair_geom1[pairs], model.pair_geom2[pairs])


def _friction(
    model: mujoco.MjModel, of_geoms: np.ndarray, geom1: np.ndarray, geom2: np.ndarray
) -> np.ndarray:
    larger = np.maximum(of_geoms[geom1], of_geoms[geom2])
    return _by_priority(model, geom1, geom2, of_geoms, larger)[:, _COEFFICIENTS]


def _parameters(
    model: mujoco.MjModel, geom1: np.ndarray, geom2: np.ndarray
) -> dict[str, np.ndarray]:
    """Returns what contacts of geoms have beside friction, by the names of a pair's attributes."""

    def mixed(values: np.ndarray) -> np.ndarray:
        return share * values[geom1] + (1 - share) * values[geom2]

    weight1, weight2 = model.geom_solmix[geom1], model.geom_solmix[geom2]
    with np.errstate(invalid='ignore'):
        share = np.where(weight1 + weight2 > 0, weight1 / (weight1 + weight2), 0.5)[:, np.newaxis]
    condim, solref, solimp = model.geom_condim, model.geom_solref, model.geom_solimp
    are_positive = (solref[geom1, :1] > 0) & (solref[geom2, :1] > 0)
    stiffer = np.minimum(solref[geom1], solref[geom2])
    common = {
        'condim': (condim, np.maximum(condim[geom1], condim[geom2])),
        'solref': (solref, np.where(are_positive, mixed(solref), stiffer)),
        'solimp': (solimp, mixed(solimp)),
    }
    parameters = {
        name: _by_priority(model, geom1, geom2, *values) for name, values in common.items()
    }
    for name, values in (('margin', model.geom_margin), ('gap', model.geom_gap)):
        parameters[name] = values[geom1] + values[geom2]
    return parameters


def _by_priority(
    model: mujoco.MjModel,
    geom1: np.ndarray,
    geom2: np.ndarray,
    values: np.ndarray,
    common: np.ndarray,
) -> np.ndarray:
    """Returns the values of the geom of higher priority or, if they are alike, common ones."""
    ahead = np.sign(model.geom_priority[geom1] - model.geom_priority[geom2])
    ahead = ahead.reshape(-1, *(1,) * (values.ndim - 1))
    return np.select([ahead > 0, ahead < 0], [values[geom1], values[geom2]], common)
