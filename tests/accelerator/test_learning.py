"""The learner on a device: the batch takes the place of the native one."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip('warp', reason="MuJoCo Warp is not installed: pip install -e '.[warp]'")
pytest.importorskip('jax', reason="JAX is not installed: pip install -e '.[learn]'")

from fetch_composer.learning import settings, train  # noqa: E402
from fetch_composer.learning.trainer import Trainer  # noqa: E402

pytestmark = pytest.mark.warp


@pytest.fixture
def options(device, tmp_path):
    small = dataclasses.replace(
        settings.for_task('reach'), num_envs=8, episode_steps=5, evaluation_episodes=8
    )
    return train.Options(
        task='reach',
        convention='documented',
        seed=0,
        settings=small,
        minutes=None,
        output_dir=tmp_path / 'run',
        device=device,
    )


def test_it_explores_updates_and_judges(options):
    trainer = Trainer('reach', 'documented', 0, options.settings, None, options.make_batch)
    for _ in range(options.settings.random_iterations + 2):
        trainer.iterate()
    assert trainer.updates
    assert np.isfinite(trainer.loss)
    assert trainer.evaluate().shape == (8,)
    trainer.close()


def test_the_device_belongs_to_the_run(options, device):
    assert f'--device {device}' in options.command
    assert options.decisive['device'] == device
    native = dataclasses.replace(options, device=None)
    assert 'device' not in native.decisive
    with pytest.raises(ValueError, match='num_threads'):
        dataclasses.replace(options, num_threads=2)
