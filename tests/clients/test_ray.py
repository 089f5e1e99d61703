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

from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.results import store
from tests import pages

pytest.importorskip('ray', reason="Ray is not installed: pip install -e '.[ray]'")

from fetch_composer.explorer.episodes import ray_rollout  # noqa: E402

pytestmark = pytest.mark.clients

_ROOT = pathlib.Path(__file__).parents[2]
_FLAGS = (
    '--mixture=expert:0.5,random:0.5', '--noise=0.2', '--max_episode_steps=8', '--num_envs=4',
    '--reward_type=dense',
)  # fmt: skip

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
import contextlib, os, pathlib, signal, time
import numpy as np
import ray
from ray.cluster_utils import Cluster
from fetch_composer.explorer.episodes import batch_rollout, ray_rollout
from fetch_composer.tasks import TaskOptions

here, run = pathlib.Path.cwd(), ray_rollout._run
log, hung = here / 'log', here / 'hung'

def first_ten_are_done():
    return len(log.read_text().splitlines()) > 10

def logged(options, seeds, num_envs, needed):
    node = ray.get_runtime_context().get_node_id()
    with log.open('a') as file:
        print(node, *seeds, file=file)
    if log.read_text().count(doomed_id) == 4 and node == doomed_id:
        hung.with_suffix('.part').write_text(f'{os.getpid()} {seeds[0]}')
        hung.with_suffix('.part').rename(hung)
        time.sleep(600)  # Until the node is killed: this task never ends on it.
    while node != doomed_id and not hung.exists() and first_ten_are_done():
        time.sleep(0.05)  # Or this node might do all before the other has begun.
    return run(options, seeds, num_envs, needed)

ray_rollout._run = logged
nodes = Cluster(initialize_head=True, head_node_args={
    'num_cpus': 1, 'include_dashboard': False,
    '_system_config': {'health_check_initial_delay_ms': 0, 'health_check_period_ms': 200,
                       'health_check_failure_threshold': 5}})
doomed = nodes.add_node(num_cpus=1)
doomed_id = doomed.node_id
options = batch_rollout.EpisodeOptions('push', 'random', TaskOptions(max_episode_steps=8))
seeds = list(range(5, 405))
killed = []

def kill(steps):
    if hung.exists() and not killed:
        pid, seed = map(int, hung.read_text().split())
        nodes.remove_node(doomed, allow_graceful=False)
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)  # Its worker would outlive it for a moment.
        killed.append(seed)

with ray_rollout.cluster(nodes.address) as rollouts, rollouts(options, 4) as rollout:
    assert len(ray.nodes()) == 2
    found = [episode for chunk in rollout.run(seeds, kill) for episode in chunk]
nodes.shutdown()

(interrupted,) = killed
begun = [line.split() for line in log.read_text().splitlines()]
runs = [node for node, first, *_ in begun if int(first) == interrupted]
assert runs[0] == doomed_id and len(runs) == 2 and runs[1] != doomed_id, runs
assert sum(node == doomed_id for node, *_ in begun) == 4
assert sorted(episode.seed for episode in found) == seeds
found.sort(key=lambda episode: episode.seed)
for one, two in zip(found, batch_rollout.run_episodes(options, seeds), strict=True):
    for name in ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward'):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
print('run again:', interrupted)
"""


def test_a_node_that_is_killed_loses_no_episode_and_counts_none_twice(isolated, tmp_path):
    (tmp_path / 'cluster.py').write_text(_CLUSTER)
    out, _ = _printed(isolated('cluster.py'))
    assert 'run again: ' in out


def test_workers_know_the_tasks_that_the_run_has_imported(isolated, tmp_path):
    (tmp_path / 'gate.py').write_text(pages.code_of('new_task.md'))
    flags = ('--policy=random', *_FLAGS[2:], '--episodes=4', '--import=gate')
    flags += ('--task=push_through_gate',)
    for output_dir, more in (('ray', ('--ray=local',)), ('whole', ())):
        _printed(isolated(_ROOT / 'explore.py', *flags, f'--output_dir={output_dir}', *more))
    one, two = _arrays(tmp_path / 'ray'), _arrays(tmp_path / 'whole')
    np.testing.assert_array_equal(one['observation'], two['observation'])


def test_an_address_where_no_cluster_is_fails_at_once(isolated, tmp_path):
    folder = f'--output_dir={tmp_path / "none"}'
    _, errors = _printed(isolated(_ROOT / 'explore.py', '--ray=127.0.0.1:9', folder), 1)
    assert 'explore.py: error: No Ray cluster answers at 127.0.0.1:9' in errors
    assert 'Traceback' not in errors


@pytest.mark.parametrize('address', ['', 'here', 'ray://', 'host', 'host:port', 'a b:1'])
def test_what_cannot_be_an_address_is_refused(address):
    with pytest.raises(ValueError, match='ray must be local, auto, HOST:PORT or ray://HOST:PORT'):
        ray_rollout.check_address(address)


def test_a_node_of_other_code_is_refused():
    options = batch_rollout.EpisodeOptions('push', 'random')
    needed = {**ray_rollout._origins('random'), 'code': 'other'}
    with pytest.raises(ray_rollout.RayError, match='differs in code from this one'):
        ray_rollout._run(options, [0], 2, needed)
