"""Ray: episodes spread over a cluster are those of this machine, whatever dies on the way.

Ray runs in a network namespace that has nothing but the loopback interface.
"""

import functools
import os
import pathlib
import signal
import subprocess
import sys
import time

import matplotlib
import numpy as np
import pytest

from fetch_composer.exploration import batch_rollout, store

pytest.importorskip('ray', reason="Ray is not installed: pip install -e '.[ray]'")

from fetch_composer.exploration import ray_rollout  # noqa: E402

pytestmark = pytest.mark.clients

_ROOT = pathlib.Path(__file__).parents[2]
_FLAGS = ('--policy=random', '--max_episode_steps=8', '--num_envs=4', '--reward_type=dense')

# SIOCSIFFLAGS with IFF_UP, as `ip link set lo up` does.
_LOOPBACK_UP = (
    'import fcntl, socket, struct; '
    'fcntl.ioctl(socket.socket(), 0x8914, struct.pack("16sh22x", b"lo", 1))'
)
_ISOLATED = ('sh', '-c', f'{sys.executable} -c \'{_LOOPBACK_UP}\' && exec "$@"', 'sh')


@functools.cache
def _isolation():
    """Returns what to put before a command, so that nothing but loopback is there; or None."""
    for unshare in (('unshare', '-n'), ('unshare', '-rn')):
        command = (*unshare, *_ISOLATED)
        try:
            if subprocess.run([*command, 'true'], capture_output=True).returncode == 0:
                return command
        except FileNotFoundError:
            break
    return None


@pytest.fixture
def isolated(tmp_path):
    """Returns a function that starts Python in isolation, with a home folder of its own."""
    if _isolation() is None:
        pytest.skip('no network namespace is permitted here, and Ray is to talk to loopback only')
    (tmp_path / 'home').mkdir()

    def start(*arguments):
        return subprocess.Popen(
            [*_isolation(), sys.executable, *map(str, arguments)],
            cwd=tmp_path,
            env={
                **os.environ,
                'HOME': str(tmp_path / 'home'),
                'MPLCONFIGDIR': matplotlib.get_configdir(),  # A new one takes seconds.
                'PYTHONPATH': str(_ROOT),
                'MUJOCO_GL': 'disabled',
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


def _printed(process, returncode=0):
    out, errors = process.communicate()
    assert process.returncode == returncode, errors
    return out, errors


def _arrays(folder):
    with np.load(folder / 'trajectories.npz') as file:
        return dict(file)


def test_a_run_that_is_stopped_and_continued_has_the_numbers_of_one_without_ray(isolated, tmp_path):
    folder, whole = tmp_path / 'ray', tmp_path / 'whole'
    flags = (*_FLAGS, '--episodes=400')
    command = (_ROOT / 'explore.py', *flags, '--ray=local', f'--output_dir={folder}')

    process = isolated(*command)
    while process.poll() is None and not list(folder.glob(f'{store.NAME}/*/episodes*.npz')):
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    out, errors = _printed(process, 128 + signal.SIGTERM)
    assert 'Stopped by SIGTERM after' in out
    assert 'Traceback' not in errors

    out, errors = _printed(isolated(*command))
    assert 'Continued: ' in out
    assert '3200/3200' in errors  # Control steps, as the progress bar has them.
    assert not (tmp_path / 'home' / '.ray').exists()

    _printed(isolated(_ROOT / 'explore.py', *flags, f'--output_dir={whole}'))
    one, two = _arrays(folder), _arrays(whole)
    assert one['seed'].tolist() == list(range(400))
    for name, array in two.items():
        np.testing.assert_array_equal(one[name], array, err_msg=name)


_CLUSTER = """
import pathlib, sys, time
import numpy as np
import ray
from ray.cluster_utils import Cluster
from fetch_composer.exploration import batch_rollout, ray_rollout

log, run = pathlib.Path('log').resolve(), ray_rollout._run

def logged(options, seeds, num_envs, needed):
    node = ray.get_runtime_context().get_node_id()
    def note(event):
        with log.open('a') as file:
            print(event, node, seeds[0], file=file)
    note('begin')
    time.sleep(0.3)  # For the node to be killed within.
    episodes = run(options, seeds, num_envs, needed)
    note('end')
    return episodes

ray_rollout._run = logged
nodes = Cluster(initialize_head=True, head_node_args={
    'num_cpus': 1, 'include_dashboard': False,
    '_system_config': {'health_check_initial_delay_ms': 0, 'health_check_period_ms': 200,
                       'health_check_failure_threshold': 5}})
doomed = nodes.add_node(num_cpus=1)
options = batch_rollout.EpisodeOptions('push', 'random', max_episode_steps=8)
seeds = list(range(5, 105))
killed = []

def kill(steps):
    events = [line.split() for line in log.read_text().splitlines()] if log.exists() else []
    here = [event for event in events if event[1] == doomed.node_id]
    if not killed and sum(event[0] == 'end' for event in here) > 2 and here[-1][0] == 'begin':
        nodes.remove_node(doomed, allow_graceful=False)
        killed.append(here[-1][2])

with ray_rollout.cluster(nodes.address) as rollouts, rollouts(options, 4) as rollout:
    assert len(ray.nodes()) == 2
    found = [episode for chunk in rollout.run(seeds, kill) for episode in chunk]
nodes.shutdown()

assert killed, 'no node was killed'
begun = [line.split() for line in log.read_text().splitlines()]
begun = [node for event, node, seed in begun if event == 'begin' and seed == killed[0]]
assert begun[0] == doomed.node_id and len(begun) > 1 and doomed.node_id not in begun[1:], begun
assert sorted(episode.seed for episode in found) == seeds
found.sort(key=lambda episode: episode.seed)
for one, two in zip(found, batch_rollout.run_episodes(options, seeds), strict=True):
    for name in ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward'):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
print('interrupted', killed[0], 'runs', len(begun))
"""


def test_a_node_that_is_killed_loses_no_episode_and_counts_none_twice(isolated, tmp_path):
    (tmp_path / 'cluster.py').write_text(_CLUSTER)
    out, _ = _printed(isolated('cluster.py'))
    assert 'interrupted' in out


def test_an_address_where_no_cluster_is_fails_at_once(isolated, tmp_path):
    folder = f'--output_dir={tmp_path / "none"}'
    _, errors = _printed(isolated(_ROOT / 'explore.py', '--ray=127.0.0.1:9', folder), 1)
    assert 'explore.py: error: No Ray cluster answers at 127.0.0.1:9' in errors
    assert 'Traceback' not in errors


@pytest.mark.parametrize('address', ['', 'here', 'ray://', 'host', 'host:port', 'a b:1'])
def test_an_address_that_is_none_is_refused(address):
    with pytest.raises(ValueError, match='ray must be local, auto, HOST:PORT or ray://HOST:PORT'):
        ray_rollout.check_address(address)


def test_a_node_of_other_code_is_refused():
    options = batch_rollout.EpisodeOptions('push', 'random')
    needed = {**ray_rollout._origins('random'), 'code': 'other'}
    with pytest.raises(ray_rollout.RayError, match='differs in code from this one'):
        ray_rollout._run(options, [0], 2, needed)
