"""Episodes spread over a Ray cluster by seed, each the same as without it.

A task of Ray runs the episodes of some seeds on a batch of its own. One whose worker dies is run
again, and its episodes arrive once.
"""

import contextlib
import functools
import logging
import math
import os
import pickle
import re
import secrets
import signal
import socket
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Any

try:
    import ray
except ImportError as error:
    raise ImportError("--ray needs Ray: pip install 'fetch_composer[ray]'.") from error

from fetch_composer import policies, user_modules
from fetch_composer.batch import simulations
from fetch_composer.explorer.episodes import batch_rollout, provenance
from fetch_composer.explorer.episodes.episode import Episode

LOCAL = 'local'

_AUTO = 'auto'
_ADDRESS = re.compile(r'(ray://)?(?P<host>[\w.-]+):(?P<port>\d{1,5})')
_Origins = dict[str, str | None]

_MAX_RETRIES = 3
_TASKS_PER_PROCESSOR = 4  # Small tasks, so that one that is slow or lost costs little.
_POLL_SECONDS = 0.2
_MOST_WAITED_FOR = 1000  # Waiting takes longer the more results are waited for.
_LOOPBACK = '127.0.0.1'
_SECONDS_TO_ANSWER = 5
_LOCAL_STORE_BYTES = 256 * 2**20


class RayError(RuntimeError):
    """Ray cannot be reached or started, or its workers keep dying."""


def check_address(address: str) -> None:
    """Raises `ValueError` if that cannot be the address of a cluster."""
    if address not in (LOCAL, _AUTO) and not _ADDRESS.fullmatch(address):
        raise ValueError(f'ray must be local, auto, HOST:PORT or ray://HOST:PORT, got {address!r}.')


def _check_answers(address: str) -> None:
    """Raises `RayError` if nothing listens there; Ray itself would try for a quarter of an hour."""
    match = _ADDRESS.fullmatch(address)
    if match is None:
        return
    host, port = match['host'], int(match['port'])
    if host in (_LOOPBACK, 'localhost') and not match[1]:
        host = ray.util.get_node_ip_address()  # Where Ray looks for it.
    try:
        socket.create_connection((host, port), _SECONDS_TO_ANSWER).close()
    except (OSError, OverflowError) as error:
        raise RayError(f'No Ray cluster answers at {address}: {error}') from error


@contextlib.contextmanager
def cluster(address: str) -> Iterator[Callable[..., 'RayRollout']]:
    """Connects to a cluster, and gives what makes rollouts on it, as `BatchRollout` does.

    A cluster of this machine alone listens on the loopback interface only, and writes to a
    temporary folder in `RAY_TMPDIR`, or where temporary files go. It sets variables `RAY_...` of
    this process.

    Args:
        address: 'local' for a cluster of this machine, which ends with the context; or where
            one is, as `ray.init` takes it. Its nodes need this package too.

    Raises:
        RayError: if there is no cluster there.
    """
    os.environ.setdefault('RAY_USAGE_STATS_ENABLED', '0')
    _check_answers(address)
    with contextlib.ExitStack() as stack:
        options: dict[str, Any] = {'address': address}
        if address == LOCAL:
            if not {'RAY_AUTH_TOKEN', 'RAY_AUTH_TOKEN_PATH'} & set(os.environ):
                # Else Ray writes one into the home folder.
                os.environ['RAY_AUTH_TOKEN'] = secrets.token_hex(32)
            folder = stack.enter_context(
                tempfile.TemporaryDirectory(
                    prefix='ray_', dir=os.environ.get('RAY_TMPDIR'), ignore_cleanup_errors=True
                )
            )
            options.update(
                num_cpus=simulations.num_processors(),
                include_dashboard=False,
                object_store_memory=_LOCAL_STORE_BYTES,
                _node_ip_address=_LOOPBACK,
                _temp_dir=folder,
            )
        stack.callback(ray.shutdown)
        handler = signal.getsignal(signal.SIGTERM)  # Which Ray replaces.
        try:
            ray.init(log_to_driver=False, logging_level=logging.ERROR, **options)
        except (
            ConnectionError,
            OSError,
            RuntimeError,
            ValueError,
            ray.exceptions.RayError,
        ) as error:
            raise RayError(f'No connection to Ray at {address!r}: {_one_line(error)}') from error
        finally:
            with contextlib.suppress(ValueError):  # Of a thread other than the main one.
                signal.signal(signal.SIGTERM, handler)
        yield RayRollout


class RayRollout:
    """Runs episodes on the cluster that this process is connected to."""

    def __init__(
        self,
        options: batch_rollout.EpisodeOptions,
        num_envs: int,
        make_policy: policies.PolicyFactory | None = None,
    ) -> None:
        """Initializes the rollout.

        Args:
            options: What to run.
            num_envs: How many episodes a task of Ray runs at most.
            make_policy: Unused, since workers load the policy that the options name.
        """
        del make_policy  # Unused.
        user_modules.load_all(options.imports)
        self._options = options
        self._num_envs = num_envs
        self._task = ray.remote(num_cpus=1, max_retries=_MAX_RETRIES)(_run)

    def run(
        self, seeds: Sequence[int], on_progress: Callable[[int], None] | None = None
    ) -> Iterator[list[Episode]]:
        """Yields the episodes, some at a time, as they are finished: each once, in any order.

        They are those of `BatchRollout.run` to the bit, from processors of one kind.

        Args:
            seeds: A non-negative integer for each episode.
            on_progress: Called several times a second with the number of control steps that were
                finished since, or are not needed; what it raises ends the run.

        Raises:
            RayError: if workers die again and again, or have other code than this process.
            PhysicsError: if the physics of an episode diverges.
        """
        on_progress = on_progress or (lambda steps: None)
        processors = int(ray.cluster_resources().get('CPU', 1)) or 1
        fair = math.ceil(len(seeds) / (processors * _TASKS_PER_PROCESSOR))
        size = max(1, min(self._num_envs, fair))
        needed = _origins(self._options.policy, self._options.imports)
        pending = [
            self._task.remote(self._options, list(seeds[start : start + size]), size, needed)
            for start in range(0, len(seeds), size)
        ]
        try:
            while pending:
                on_progress(0)
                done, waiting = ray.wait(pending[:_MOST_WAITED_FOR], timeout=_POLL_SECONDS)
                pending = waiting + pending[_MOST_WAITED_FOR:]
                for each in done:
                    episodes = _result(each)
                    yield episodes
                    on_progress(self._options.steps * len(episodes))
        finally:
            for each in pending:
                ray.cancel(each)

    def close(self) -> None:
        """Does nothing: simulations are those of the workers."""

    def __enter__(self) -> 'RayRollout':
        return self

    def __exit__(self, *unused_exception) -> None:
        self.close()


def _result(reference) -> list[Episode]:
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except ray.exceptions.RayError as error:
        raise RayError(f'Ray has lost a worker too often: {_one_line(error)}') from error


def _one_line(error: Exception) -> str:
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


# -- What workers run ------------------------------------------------------------------------------


def _run(
    options: batch_rollout.EpisodeOptions, seeds: list[int], num_envs: int, needed: _Origins
) -> list[Episode]:
    # Loads modules and policy, so that where they come from is known.
    batch_of_worker = _batch(pickle.dumps(options), num_envs)
    here = _origins(options.policy, options.imports)
    differing = sorted(name for name in needed if here.get(name) != needed[name])
    if differing:
        raise RayError(
            f'A node of the Ray cluster differs in {", ".join(differing)} from this one: install '
            'the same on both, or episodes would not be the same.'
        )
    return [episode for chunk in batch_of_worker.run(seeds) for episode in chunk]


@functools.lru_cache(maxsize=1)
def _batch(pickled_options: bytes, num_envs: int) -> batch_rollout.BatchRollout:
    """Returns a batch on one thread, which a worker process makes once."""
    options = pickle.loads(pickled_options)
    return batch_rollout.BatchRollout(options, num_envs, num_threads=1)


@functools.lru_cache(maxsize=1)
def _origins(policy: str, imports: tuple[str, ...] = ()) -> _Origins:
    """Returns versions and digests of what decides on episodes, in this process."""
    versions = {name: each for name, each in provenance.versions().items() if name != 'python'}
    return {
        **versions,
        'code': provenance.code_digest(),
        'policy': policies.digest(policy),
        **{each: user_modules.digest(each) for each in imports},
    }
