"""The batch on a device, as far as a minute goes; the rest is in tests/accelerator."""

import numpy as np
import pytest

pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")

import fetch_composer  # noqa: E402
from fetch_composer import warp_batch  # noqa: E402


def test_it_steps_as_the_native_batch_does():
    native = fetch_composer.BatchEnvironment('reach', 2, seed=0)
    native.reset()
    with warp_batch.WarpBatchEnvironment('reach', 2, 'cpu', seed=0) as batch:
        batch.reset()
        batch.set_states(native.get_states())
        for _ in range(3):
            actions = np.full((2, 4), 0.5, np.float32)
            expected = native.step(actions)
            found = warp_batch.as_numpy(batch.step(actions))
            for name, value in expected.observation.items():
                np.testing.assert_allclose(found.observation[name], value, rtol=0, atol=1e-5)
            np.testing.assert_array_equal(found.step_type, expected.step_type)
            np.testing.assert_array_equal(found.reward, expected.reward)
