"""What tests of a batch on a device do with it and its time steps."""

import numpy as np

from fetch_composer.warp_batch import as_numpy

ROUNDING = 1e-6  # The order in which a GPU adds numbers up is not the same each time.


def zeros(batch):
    return np.zeros((batch.num_envs, 4), np.float32)


def observation_of(time_step):
    return as_numpy(time_step).observation['observation']
