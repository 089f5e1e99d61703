"""The public faces, given anything: each refuses it and names it, or does what it promises."""

import contextlib
import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import hypothesis
import numpy as np
from hypothesis import strategies as st

import fetch_composer
from fetch_composer import tasks
from fetch_composer.explorer import flags
from fetch_composer.tasks import conventions, variations
from tests.hostile import values
from tests.hostile.tally import Tally

_ROWS = 3
_VARIANTS = tuple((task, each) for task in fetch_composer.ALL for each in conventions.CONVENTIONS)


def _fuzz(seed: int, examples: int, check: Callable[..., None], **strategies) -> None:
    """Calls a check with examples that follow from a seed alone."""
    settings = hypothesis.settings(
        max_examples=examples,
        database=None,
        deadline=None,
        print_blob=False,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # Of numpy, about what is given to it.
        hypothesis.seed(seed)(settings(hypothesis.given(**strategies)(check)))()


@contextlib.contextmanager
def _refused_or_right(tally: Tally, *names: str) -> Iterator[None]:
    """Lets errors pass that say what is wrong, and by one of these names where."""
    try:
        yield
    except (TypeError, ValueError) as error:
        assert any(name in str(error) for name in names), f'names nothing: {error!r}'
        tally.add(was_refused=True)
    else:
        tally.add(was_refused=False)


def equal(one: Any, other: Any) -> bool:
    """Returns whether two states are the same to the bit."""
    if dataclasses.is_dataclass(one):
        return all(
            equal(getattr(one, field.name), getattr(other, field.name))
            for field in dataclasses.fields(one)
        )
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[name], other[name]) for name in one)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.tobytes() == other.tobytes()
    return bool(one == other)


def _check_finite(observation) -> None:
    for name, value in observation.items():
        assert value.dtype == np.float64 and np.isfinite(value).all(), (name, value)


@functools.cache
def _single(task: str, convention: str):
    env = fetch_composer.load(task, seed=0, convention=convention)
    env.reset()
    return env


@functools.cache
def _batch(task: str, convention: str):
    batch = fetch_composer.BatchEnvironment(task, _ROWS, seed=0, convention=convention)
    batch.reset()
    return batch


def actions(tally: Tally, seed: int, examples: int) -> None:
    """Gives a single environment actions."""

    def check(variant, action) -> None:
        env = _single(*variant)
        before = env.get_state()
        try:
            with _refused_or_right(tally, 'action', 'Action'):
                _check_finite(env.step(action).observation)
                before = None
        finally:
            assert before is None or equal(before, env.get_state()), 'refused, and has moved'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(_VARIANTS), action=st.one_of(values.ANYTHING, values.vectors(4)),
    )  # fmt: skip


def batch_actions(tally: Tally, seed: int, examples: int) -> None:
    """Gives a batch actions."""

    def check(variant, action) -> None:
        batch = _batch(*variant)
        before = batch.get_states()
        with _refused_or_right(tally, 'action', 'Action'):
            _check_finite(batch.step(action).observation)
            before = None
        assert before is None or equal(before, batch.get_states()), 'refused, and has moved'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(_VARIANTS),
        action=st.one_of(values.ANYTHING, values.matrices(_ROWS, 4)),
    )  # fmt: skip


def batch_resets(tally: Tally, seed: int, examples: int) -> None:
    """Resets a batch with ids, places and seeds."""
    given = {
        'ids': st.one_of(values.ANYTHING, st.lists(st.integers(-1, _ROWS), max_size=_ROWS)),
        'object_position': st.one_of(values.ANYTHING, values.vectors(2), values.matrices(_ROWS, 2)),
        'goal': st.one_of(values.ANYTHING, values.vectors(3), values.matrices(_ROWS, 3)),
        'seed': st.one_of(values.ANYTHING, st.lists(st.integers(0, 2**64), max_size=_ROWS + 1)),
    }

    def check(variant, arguments) -> None:
        batch = _batch(*variant)
        before = batch.get_states()
        with _refused_or_right(tally, *arguments, 'seeds'):
            _check_finite(batch.reset(**arguments).observation)
            before = None
        assert before is None or equal(before, batch.get_states()), 'refused, and has changed'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(_VARIANTS), arguments=st.fixed_dictionaries({}, optional=given),
    )  # fmt: skip


def gymnasium_resets(tally: Tally, seed: int, examples: int) -> None:
    """Resets Gymnasium's faces with seeds and options."""
    option = st.one_of(
        values.ANYTHING,
        st.fixed_dictionaries(
            {},
            optional={
                'goal': st.one_of(values.ANYTHING, values.vectors(3)),
                'object_position': st.one_of(values.ANYTHING, values.vectors(2)),
                'reset_mask': values.ANYTHING,
            },
        ),
    )
    given = {'seed': values.ANYTHING, 'options': option}

    def check(face, arguments) -> None:
        env = _gymnasium(face)
        names = ('option', 'seed', 'goal', 'object_position', 'ids')
        with _refused_or_right(tally, *names):
            _check_finite(env.reset(**arguments)[0])

    _fuzz(
        seed, examples, check,
        face=st.sampled_from(('single', 'vector')),
        arguments=st.fixed_dictionaries({}, optional=given),
    )  # fmt: skip


@functools.cache
def _gymnasium(face: str):
    from fetch_composer.interfaces import gymnasium_env, gymnasium_vector

    if face == 'single':
        return gymnasium_env.FetchEnv('push')
    return gymnasium_vector.FetchVectorEnv('push', _ROWS)


def rewards(tally: Tally, seed: int, examples: int) -> None:
    """Asks for the reward of goals."""
    goal = st.one_of(values.ANYTHING, values.vectors(3), values.matrices(2, 3))

    def check(achieved, desired, reward_type) -> None:
        with _refused_or_right(tally, 'achieved_goal', 'desired_goal', 'reward_type'):
            reward = tasks.compute_reward(achieved, desired, reward_type)
            assert reward.dtype == np.float64

    _fuzz(
        seed, examples, check,
        achieved=goal, desired=goal,
        reward_type=st.one_of(st.sampled_from(('sparse', 'dense')), values.ANYTHING),
    )  # fmt: skip


# Names by which a message may call an option, beside its own.
_ALSO = {'pixels': ('camera',), 'variations': ('variation', *variations.NAMES)}


def options(tally: Tally, seed: int, examples: int) -> None:
    """Loads tasks with options, one of them hostile."""
    names = st.sampled_from([field.name for field in dataclasses.fields(tasks.TaskOptions)])
    of_pixels = st.dictionaries(
        st.sampled_from(('cameras', 'height', 'depth', 'supersampling', 'other')),
        values.ANYTHING,
        min_size=1,
    )
    of_variations = st.dictionaries(
        st.sampled_from((*variations.NAMES, 'other')), values.ANYTHING, min_size=1, max_size=2
    )

    def check(variant, name, value) -> None:
        task, convention = variant
        given = {'convention': convention, name: value}
        with _refused_or_right(tally, name, *_ALSO.get(name, ())):
            env = fetch_composer.load(task, seed=0, **given)
            with contextlib.closing(env):
                _check_finite(env.reset().observation)
                _check_finite(env.step(np.ones(4, np.float32)).observation)

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(_VARIANTS),
        name=names,
        value=st.one_of(
            values.ANYTHING, values.vectors(3), values.vectors(2), of_pixels, of_variations
        ),
    )  # fmt: skip


def explorer_options(tally: Tally, seed: int, examples: int) -> None:
    """Makes the options of a run, one of them hostile."""
    chosen = (
        'episodes', 'seed', 'num_envs', 'num_films', 'films', 'width', 'height', 'fps', 'step',
        'supersampling', 'goal', 'object_position', 'convention', 'max_episode_steps', 'noise',
        'mixture', 'dataset',
    )  # fmt: skip

    def check(name, value) -> None:
        with _refused_or_right(tally, name):
            flags.make_options({name: value}).check()

    _fuzz(seed, examples, check, name=st.sampled_from(chosen), value=values.ANYTHING)


ALL: dict[str, Callable[[Tally, int, int], None]] = {
    'actions of a single environment': actions,
    'actions of a batch': batch_actions,
    'resets of a batch: ids, places, seeds': batch_resets,
    "Gymnasium's resets: seeds, options": gymnasium_resets,
    'goals of `compute_reward`': rewards,
    'options of `load`': options,
    'options of the explorer': explorer_options,
}
