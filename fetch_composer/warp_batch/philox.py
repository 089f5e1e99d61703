"""A counter-based generator: what is drawn follows from a key and a place in its stream alone.

It is Philox4x32 of ten rounds, by J. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3"
(SC 2011), so that environments draw on a device without a state that they would have to share.
"""

import warp as wp

Block = wp.types.vector(length=4, dtype=wp.uint32)
Key = wp.types.vector(length=2, dtype=wp.uint32)

_MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
_WEYL = (0x9E3779B9, 0xBB67AE85)  # What the key grows by each round.
_ROUNDS = 10

_M0, _M1 = (wp.constant(wp.uint64(each)) for each in _MULTIPLIERS)
_W0, _W1 = (wp.constant(wp.uint32(each)) for each in _WEYL)
_WORD = wp.constant(wp.uint64(32))
_UNUSED_BITS = wp.constant(wp.uint32(8))  # A float32 holds 24.
_STEP = wp.constant(2.0**-24)


@wp.func
def block(counter: Block, key: Key) -> Block:
    """Returns four random words for a counter of four and a key of two."""
    c0, c1, c2, c3 = counter[0], counter[1], counter[2], counter[3]
    k0, k1 = key[0], key[1]
    for _ in range(_ROUNDS):
        product0 = _M0 * wp.uint64(c0)
        product1 = _M1 * wp.uint64(c2)
        c0 = wp.uint32(product1 >> _WORD) ^ c1 ^ k0
        c1 = wp.uint32(product1)
        c2 = wp.uint32(product0 >> _WORD) ^ c3 ^ k1
        c3 = wp.uint32(product0)
        k0 += _W0
        k1 += _W1
    return Block(c0, c1, c2, c3)


@wp.func
def uniform(key: Key, stream: wp.uint32, index: int) -> float:
    """Returns one of the numbers, uniform in [0, 1), of a stream of a key."""
    words = block(Block(wp.uint32(index // 4), stream, wp.uint32(0), wp.uint32(0)), key)
    return float(words[index % 4] >> _UNUSED_BITS) * _STEP


@wp.func
def between(key: Key, stream: wp.uint32, index: int, half_range: float) -> float:
    """Returns one of the numbers of a stream, uniform in [-half_range, half_range)."""
    return (2.0 * uniform(key, stream, index) - 1.0) * half_range
