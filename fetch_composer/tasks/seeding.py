"""Seeds, and the generator that they give: Gymnasium's own."""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from fetch_composer.tasks import checks


class SeededRandomState(np.random.RandomState):
    """`RandomState` over the generator, seeded in the way, that Gymnasium uses.

    Its uniform draws are those of `gymnasium.utils.seeding.np_random(seed)`.
    """

    def __init__(self, seed: int | None = None) -> None:
        """Initializes the generator.

        Args:
            seed: A non-negative integer, or None for entropy from the operating system.
        """
        super().__init__(np.random.PCG64(np.random.SeedSequence(seed)))

    def get_state(self, legacy: bool = False):
        """Returns the state as a dict, since this generator has no legacy form."""
        del legacy  # Unused.
        return super().get_state(legacy=False)


def check_seed(seed) -> int | None:
    """Returns a seed as an integer, or None.

    Raises:
        ValueError: if it is neither None nor a non-negative integer: of Python, of NumPy, or an
            array of no dimension (JAX's scalars are such).
    """
    return None if seed is None else checks.integer('seed', seed, 0, 'None for entropy')


def seeds_of_many(seed, count: int) -> list[int | None]:
    """Returns a seed for each of `count` environments.

    Args:
        seed: Seed of the first, after which the others' count up; or one for each; or None.
        count: How many environments there are.

    Raises:
        ValueError: as `check_seed` does, or if there is not one seed for each.
    """
    if seed is None:
        return [None] * count
    if not isinstance(seed, (list, tuple, range)) and not getattr(seed, 'ndim', 0):
        first = checks.integer('seed', seed, 0, 'None for entropy, or one for each environment')
        return [first + i for i in range(count)]
    seeds = [check_seed(each) for each in seed]
    if len(seeds) != count:
        raise ValueError(f'{count} seeds are needed, got {len(seeds)}.')
    return seeds


def random_state(seed) -> np.random.RandomState:
    """Returns what to draw from, given a seed or a `numpy.random.RandomState`.

    Raises:
        ValueError: as `check_seed` does.
    """
    if isinstance(seed, np.random.RandomState):
        return seed
    return SeededRandomState(check_seed(seed))


@functools.cache
def _trial(kind: str) -> np.random.RandomState:
    """Returns a generator that nothing is drawn from."""
    return np.random.RandomState(getattr(np.random, kind)())


def check_generator(generator: np.random.RandomState, state: Mapping[str, Any]) -> None:
    """Raises `ValueError` if a state is not one of such a generator."""
    needed = generator.get_state(legacy=False)['bit_generator']
    kind = state.get('bit_generator') if isinstance(state, Mapping) else state
    if not isinstance(kind, str) or kind != needed:
        raise ValueError(
            f'The state has a generator of kind {checks.shown(kind)}; this environment draws '
            f'from {needed}. Seed both in the same way.'
        )
    try:
        _trial(needed).set_state(dict(state))
    except (ValueError, TypeError, LookupError, OverflowError) as error:
        raise ValueError(f"The state's generator is not one of {needed}: {error}.") from None
