"""Generators of policies that draw, each with a stream of its own.

An environment with the same seed draws from `SeedSequence(seed)`. A policy that drew from it as
well would repeat those very draws, and its actions would tell of the goal.
"""

import numpy as np

UNIFORM = 1
NOISE = 2
MIXTURE = 3


def generator(seed: int | None, stream: int) -> np.random.Generator:
    """Returns a generator.

    Args:
        seed: A non-negative integer, or None for entropy from the operating system.
        stream: One of those above; draws of two of them are independent.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(stream,))))
