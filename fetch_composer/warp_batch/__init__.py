"""Many environments that step together on an accelerator, with MuJoCo Warp."""

try:
    import mujoco_warp  # noqa: F401
except ImportError as error:
    raise ImportError("It needs MuJoCo Warp: pip install 'fetch_composer[warp]'.") from error

from fetch_composer.warp_batch.arrays import as_jax, as_numpy, as_torch
from fetch_composer.warp_batch.warp_batch_environment import WarpBatchEnvironment

__all__ = ('WarpBatchEnvironment', 'as_jax', 'as_numpy', 'as_torch')
