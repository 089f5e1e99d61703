"""Observables that hand out an array of their own at every call."""

from collections.abc import Callable

import numpy as np
from dm_control.composer.observation import observable


class FreshObservable(observable.Generic):
    """What a function returns that makes a new array each time, so that none need be copied."""

    def __init__(self, read: Callable[[], np.ndarray]) -> None:
        """Initializes the observable.

        Args:
            read: Takes nothing and returns a new array.
        """
        super().__init__(lambda physics: read())
        self.read = read
