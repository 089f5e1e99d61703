"""What is compared with what, and how the comparison should come out."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal

from benchmarks.meters import OWN, RAY, MemoryPerEnvironment, Meter, WholeProcess, Worker
from benchmarks.workers.rounds import EPISODE_STEPS
from fetch_composer.batch.simulations import num_processors

GYMNASIUM_ROBOTICS = 'gymnasium_robotics'
ENVPOOL = 'envpool'
PEERS = (GYMNASIUM_ROBOTICS, ENVPOOL)

NUM_ENVS = (1, 8, 64, 256, 1024)
_ENVPOOL_NUM_ENVS = (1, 8, 64, 256)  # 1024 of EnvPool's take 9 GiB.

_SINGLE_STEPS = 200  # Control steps in a round of a single environment ...
_BATCH_STEPS = 1600  # ... and of a batch, over all of its environments.
_CALLS = 100  # Of another operation than a step.
_EPISODES = 128
_PICTURES = 20
_PICTURE_SIZES = (84, 480)  # Pixels, high and wide.
_PICTURE_NUM_ENVS = 16

_COMPOSER_START = "import fetch_composer; fetch_composer.load('push', seed=0).reset()"
_ROBOTICS_START = (
    'import gymnasium, gymnasium_robotics; gymnasium.register_envs(gymnasium_robotics); '
    "gymnasium.make('FetchPush-v4').reset(seed=0)"
)


@dataclasses.dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        group: What it is about, such as 'single'.
        ours: Our side.
        peer: The other side.
        quantity: 'speed', of which more is better, or 'time' or 'memory', of which less is. The
            ratio is ours over the peer's.
        unit: Of what each side measures: 's' or 'B', for each control step of one environment,
            each reset, each start, each episode or each environment.
        goal: At least this ratio of speeds, or at most this ratio of times; None without one.
        num_envs: How many environments there are.
        pairs: How many pairs are measured, as a multiple of what is asked for.
        warms_up: Whether the first rounds are discarded.
    """

    group: str
    ours: Meter
    peer: Meter
    quantity: Literal['speed', 'time', 'memory']
    unit: Literal['s', 'B'] = 's'
    goal: float | None = None
    num_envs: int = 1
    pairs: float = 1.0
    warms_up: bool = True

    def ratio(self, ours: float, peer: float) -> float:
        """Returns our quantity over the peer's, given what each side took."""
        return peer / ours if self.quantity == 'speed' else ours / peer

    def reached(self, ratio: float) -> bool | None:
        """Returns whether a ratio reaches the goal; None without a goal."""
        if self.goal is None:
            return None
        return ratio >= self.goal if self.quantity == 'speed' else ratio <= self.goal


def _single(
    convention: str, interface: str = 'dm_env', operation: str = 'step', resets: bool = False
) -> Worker:
    names = {'documented': 'documented', 'gymnasium_robotics': '-v4'}
    interfaces = {'dm_env': 'dm_env', 'gymnasium': 'gym.make'}
    options = {
        'convention': convention,
        'interface': interface,
        'operation': operation,
        'num_steps': _SINGLE_STEPS if operation == 'step' else _CALLS,
        'resets': resets,
    }
    label = f'{names[convention]}, {interfaces[interface]}'
    if operation != 'step':
        label = f'{operation} of {label}'
    return Worker(label, OWN, 'composer_single', options)


def _batch(label: str, interpreter: str, module: str, num_envs: int, **options) -> Worker:
    # With resets, whole episodes.
    fewest = EPISODE_STEPS if options.get('resets') else 10
    num_steps = min(_SINGLE_STEPS, max(fewest, _BATCH_STEPS // num_envs))
    options.update(
        num_envs=num_envs, num_threads=min(num_envs, num_processors()), num_steps=num_steps
    )
    return Worker(label, interpreter, module, options)


_BARE = Worker('bare mj_step(nstep=20)', OWN, 'bare_single', {'num_steps': _SINGLE_STEPS})
_ROBOTICS = Worker(
    'Gymnasium-Robotics FetchPush-v4',
    GYMNASIUM_ROBOTICS,
    'robotics_single',
    {'num_steps': _SINGLE_STEPS},
)


def single_rows() -> list[Row]:
    """Returns the rows of a single environment's control steps."""
    documented, v4 = _single('documented'), _single('gymnasium_robotics')
    v2_made, v4_made = (
        _single('documented', 'gymnasium'),
        _single('gymnasium_robotics', 'gymnasium'),
    )
    return [
        Row('single', documented, _BARE, 'speed'),
        Row('single', documented, _ROBOTICS, 'speed'),
        Row('single', v2_made, _ROBOTICS, 'speed'),
        Row('single', v4, _ROBOTICS, 'speed', goal=2.3),
        Row('single', v4_made, _ROBOTICS, 'speed'),
    ]


def rollout_row(num_envs: int) -> Row:
    """Returns a batch against `mujoco.rollout` of as many simulations."""
    ours = _batch(f'batch of {num_envs}', OWN, 'composer_batch', num_envs)
    peer = _batch('bare mujoco.rollout', OWN, 'bare_batch', num_envs, method='rollout')
    goal = {1: 0.90, 64: 1.20}.get(num_envs)
    pairs = min(1.0, 256 / num_envs)
    return Row('batch', ours, peer, 'speed', goal=goal, num_envs=num_envs, pairs=pairs)


def bare_batch_row(num_envs: int) -> Row:
    """Returns a batch against `mujoco.batch` of as many simulations."""
    ours = _batch(f'batch of {num_envs}', OWN, 'composer_batch', num_envs)
    peer = _batch('bare mujoco.batch', OWN, 'bare_batch', num_envs, method='batch')
    return Row('batch', ours, peer, 'speed', num_envs=num_envs)


def envpool_row(num_envs: int, convention: str = 'documented') -> Row:
    """Returns a batch against EnvPool with as many environments and threads."""
    version = ' of -v4' if convention == 'gymnasium_robotics' else ''
    ours = _batch(
        f'batch{version} of {num_envs}', OWN, 'composer_batch', num_envs, convention=convention
    )
    peer = _batch('EnvPool FetchPush-v4', ENVPOOL, 'envpool_batch', num_envs)
    goal = 4.4 if num_envs == 64 and convention == 'documented' else None
    return Row('batch', ours, peer, 'speed', goal=goal, num_envs=num_envs, pairs=0.5)


def with_resets_rows() -> list[Row]:
    """Returns rows of whole episodes: of control steps, and of the resets between them."""

    def with_resets(worker: Worker) -> Worker:
        return dataclasses.replace(worker, options={**worker.options, 'resets': True})

    documented, v4 = (
        _single(convention, resets=True) for convention in ('documented', 'gymnasium_robotics')
    )
    batch, rollout, envpool = (
        _batch(label, interpreter, module, 64, resets=True)
        for label, interpreter, module in (
            ('batch of 64', OWN, 'composer_batch'),
            ('bare mujoco.rollout', OWN, 'bare_batch'),
            ('EnvPool FetchPush-v4', ENVPOOL, 'envpool_batch'),
        )
    )
    group = 'with resets'
    return [
        Row(group, documented, with_resets(_BARE), 'speed', goal=0.92),
        Row(group, documented, with_resets(_ROBOTICS), 'speed', goal=4.0),
        Row(group, v4, with_resets(_ROBOTICS), 'speed', goal=2.3),
        Row(group, batch, rollout, 'speed', num_envs=64, pairs=0.5),
        Row(group, batch, envpool, 'speed', num_envs=64, pairs=0.3),
    ]


def _against_step(group: str, operation: str, convention: str, goal: float) -> Row:
    """Returns an operation against a control step of the same environment."""
    peer = dataclasses.replace(_single(convention), label='one control step of it')
    return Row(group, _single(convention, operation=operation), peer, 'time', goal=goal)


def reset_rows() -> list[Row]:
    """Returns the rows of a reset."""
    return [
        _against_step('reset', 'reset', convention, 1.0)
        for convention in ('documented', 'gymnasium_robotics')
    ]


def state_rows() -> list[Row]:
    """Returns the rows of taking a state, and of restoring it."""
    return [
        _against_step('state', operation, 'documented', 0.1)
        for operation in ('get_state', 'set_state')
    ]


def pixels_rows() -> list[Row]:
    """Returns the rows of control steps with a picture each.

    They are against MuJoCo's own renderer, and a batch against a single environment.
    """
    single = [
        Row(
            'pixels',
            Worker(f'{size}x{size} observed', OWN, 'pixels', {**options, 'method': 'environment'}),
            Worker('bare mj_step, mujoco.Renderer', OWN, 'pixels', {**options, 'method': 'bare'}),
            'speed',
            pairs=0.3,
        )
        for size in _PICTURE_SIZES
        for options in ({'num_steps': _PICTURES, 'size': size},)
    ]
    small = single[0].ours
    assert isinstance(small, Worker)
    options = {'size': _PICTURE_SIZES[0], 'num_steps': 2, 'method': 'batch'}
    batch = Worker(
        f'batch of {_PICTURE_NUM_ENVS}, {small.label}',
        OWN,
        'pixels',
        {**options, 'num_envs': _PICTURE_NUM_ENVS},
    )
    return [*single, Row('pixels', batch, small, 'speed', num_envs=_PICTURE_NUM_ENVS, pairs=0.3)]


def start_up_row() -> Row:
    """Returns the row of the time from an interpreter's start to its end after one reset."""
    ours = WholeProcess('import, load, reset', OWN, _COMPOSER_START)
    peer = WholeProcess('Gymnasium-Robotics FetchPush-v4', GYMNASIUM_ROBOTICS, _ROBOTICS_START)
    return Row('start-up', ours, peer, 'time', goal=1.3, pairs=0.3)


def ray_row() -> Row:
    """Returns the row of an episode over Ray against one without it; both use every processor."""
    ours, peer = (
        Worker(
            label,
            interpreter,
            'episodes',
            {'num_episodes': _EPISODES, 'num_envs': 64, 'over_ray': interpreter == RAY},
        )
        for label, interpreter in (('episode over Ray, local', RAY), ('the same without Ray', OWN))
    )
    return Row('ray', ours, peer, 'time', num_envs=64, pairs=0.3)


def memory_rows() -> list[Row]:
    """Returns the rows of memory for each added environment."""
    # A batch of ours adds so little that it takes many to be seen.
    single = MemoryPerEnvironment('documented, dm_env', OWN, 'composer_single', (2, 10))
    batch = MemoryPerEnvironment('batch', OWN, 'composer_batch', (64, 1088))
    robotics = MemoryPerEnvironment(
        'Gymnasium-Robotics FetchPush-v4', GYMNASIUM_ROBOTICS, 'robotics_single', (2, 10)
    )
    envpool = MemoryPerEnvironment('EnvPool FetchPush-v4', ENVPOOL, 'envpool_batch', (8, 40))
    return [
        Row('memory', ours, peer, 'memory', unit='B', goal=goal, pairs=0.1, warms_up=False)
        for ours, peer, goal in ((single, robotics, 0.9), (batch, envpool, None))
    ]


def growth_sides(sizes: Sequence[int] = NUM_ENVS) -> list[tuple[int, Meter]]:
    """Returns pairs of a number of environments and what steps as many."""
    return [
        (num_envs, side)
        for num_envs in sizes
        for side in (
            _batch('fetch_composer', OWN, 'composer_batch', num_envs),
            _batch('bare mujoco.rollout', OWN, 'bare_batch', num_envs, method='rollout'),
            _batch('EnvPool FetchPush-v4', ENVPOOL, 'envpool_batch', num_envs),
        )
        if side.interpreter != ENVPOOL or num_envs in _ENVPOOL_NUM_ENVS
    ]


def all_rows() -> list[Row]:
    """Returns the whole table."""
    return [
        *single_rows(),
        *with_resets_rows(),
        *(rollout_row(num_envs) for num_envs in NUM_ENVS),
        bare_batch_row(64),
        *(envpool_row(num_envs) for num_envs in _ENVPOOL_NUM_ENVS),
        envpool_row(64, 'gymnasium_robotics'),
        *reset_rows(),
        *state_rows(),
        *pixels_rows(),
        start_up_row(),
        ray_row(),
        *memory_rows(),
    ]


def quick_rows() -> list[Row]:
    """Returns a few rows that need no peer."""
    return [single_rows()[0], rollout_row(8), reset_rows()[0]]


@dataclasses.dataclass(frozen=True)
class Breakdown:
    """A control step whose time is taken apart.

    Attributes:
        label: What it is a control step of.
        worker: What measures it.
    """

    label: str
    worker: Worker


def breakdowns() -> list[Breakdown]:
    """Returns the control steps that are taken apart."""
    batch: dict[str, Any] = {'num_envs': 64, 'num_threads': num_processors()}
    cases: dict[str, dict[str, Any]] = {
        'documented': {'convention': 'documented'},
        '-v4': {'convention': 'gymnasium_robotics'},
        'documented, batch of 64': {'convention': 'documented', **batch},
        '-v4, batch of 64': {'convention': 'gymnasium_robotics', **batch},
    }
    return [
        Breakdown(label, Worker(label, OWN, 'breakdown', options))
        for label, options in cases.items()
    ]
