"""Values that nobody should give, and some that one may, as strategies of Hypothesis."""

import decimal
import fractions

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

_DTYPES = (
    np.float64, np.float32, np.float16, np.int64, np.uint8, np.bool_, np.complex128, object,
    'U3', 'S3', 'M8[s]',
)  # fmt: skip


def _masked(array: np.ndarray) -> np.ndarray:
    mask = np.zeros(array.shape, bool)
    mask.flat[:1] = True
    return np.ma.array(array, mask=mask)


def _filled(shape, dtype) -> np.ndarray:
    try:
        return np.ones(shape, dtype)
    except (TypeError, ValueError):
        return np.zeros(shape, dtype)


_NUMBERS = st.one_of(
    st.floats(),
    st.floats(-1, 1.5),
    st.integers(-3, 3),
    st.sampled_from((2**31, 2**63 - 1, 2**63, 2**64, 10**400, -(10**400), 10**5000, 5e-324)),
    st.booleans(),
    st.complex_numbers(),
    st.sampled_from((np.float32(0.5), np.int8(1), np.bool_(True), np.float64('nan'))),
    st.sampled_from((decimal.Decimal('0.5'), fractions.Fraction(1, 3), np.ma.masked)),
)
_SCALARS = st.one_of(
    _NUMBERS,
    st.none(),
    st.text(max_size=5),
    st.binary(max_size=5),
    st.builds(object),
    st.sampled_from((int, print, ..., NotImplemented, range(3))),
)
_ARRAYS = st.builds(
    _filled,
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
    st.sampled_from(_DTYPES),
)

# Anything at all.
ANYTHING = st.one_of(
    _SCALARS,
    st.lists(_SCALARS, max_size=5),
    st.lists(st.lists(_NUMBERS, max_size=4), max_size=4),
    st.dictionaries(st.one_of(st.text(max_size=5), st.integers()), _SCALARS, max_size=3),
    st.sets(st.integers(), max_size=3),
    _ARRAYS,
    _ARRAYS.map(_masked),
)


def vectors(size: int):
    """Returns a strategy for what has the right length at least, of all kinds of numbers."""
    return st.one_of(
        st.lists(_NUMBERS, min_size=size, max_size=size),
        st.lists(st.floats(-2, 2), min_size=size, max_size=size),
        arrays.arrays(np.float32, (size,), elements=st.floats(-2, 2, width=32)),
        arrays.arrays(np.float64, (size,), elements=st.floats()),
        st.sampled_from(_DTYPES).map(lambda dtype: _filled((size,), dtype)),
        st.sampled_from(_DTYPES).map(lambda dtype: _masked(_filled((size,), dtype))),
    )


def matrices(rows: int, size: int):
    """Returns a strategy for as many of them, and sometimes for one too many or too few."""
    return st.one_of(
        st.integers(rows - 1, rows + 1).flatmap(
            lambda count: st.lists(vectors(size), min_size=count, max_size=count)
        ),
        arrays.arrays(np.float32, (rows, size), elements=st.floats(-2, 2, width=32)),
        arrays.arrays(np.float64, (rows, size), elements=st.floats()),
        st.sampled_from(_DTYPES).map(lambda dtype: _filled((rows, size), dtype)),
        st.sampled_from(_DTYPES).map(lambda dtype: _masked(_filled((rows, size), dtype))),
    )
