"""The public faces, given anything: each refuses it and names it, or does what it promises."""

import contextlib
import dataclasses
import functools
import warnings
from collections.abc import Callable, Iterator

import hypothesis
import numpy as np
from dm_control.rl import control
from hypothesis import strategies as st

import fetch_composer
from fetch_composer import tasks
from fetch_composer.explorer import flags
from fetch_composer.tasks import variations
from fetch_composer.tasks.state import State
from tests.hostile import values, variants
from tests.hostile.tally import Tally

_ROWS = 3
_ACTIONS = st.one_of(*map(values.vectors, variants.ACTION_SIZES))
_BATCH_ACTIONS = st.one_of(*(values.matrices(_ROWS, size) for size in variants.ACTION_SIZES))
# Of one object, and of two.
_PLACES = {'object_position': (2, 4), 'goal': (3, 6)}


def _places(name: str) -> st.SearchStrategy:
    """Returns a strategy for a place, or one for each row, of all kinds of numbers."""
    sizes = _PLACES[name]
    rows = (values.matrices(_ROWS, size) for size in sizes)
    return st.one_of(values.ANYTHING, *map(values.vectors, sizes), *rows)


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
    except (TypeError, ValueError, ImportError) as error:  # The last of a library that is missing.
        assert any(name in str(error) for name in names), f'names nothing: {error!r}'
        tally.add(was_refused=True)
    else:
        tally.add(was_refused=False)


def _check_finite(observation) -> None:
    for name, value in observation.items():
        assert value.dtype == np.float64 and np.isfinite(value).all(), (name, value)


@functools.cache
def _single(variant):
    env = variants.single(variant)
    env.reset()
    return env


@functools.cache
def _batch(variant):
    batch = variants.batch(variant, _ROWS)
    batch.reset()
    return batch


def actions(tally: Tally, seed: int, examples: int) -> None:
    """Gives a single environment actions."""

    def check(variant, action) -> None:
        env = _single(variant)
        before = env.get_state()
        try:
            with _refused_or_right(tally, 'action', 'Action'):
                _check_finite(env.step(action).observation)
                before = None
        finally:
            assert before is None or before == env.get_state(), 'refused, and has moved'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(variants.ALL), action=st.one_of(values.ANYTHING, _ACTIONS),
    )  # fmt: skip


def batch_actions(tally: Tally, seed: int, examples: int) -> None:
    """Gives a batch actions."""

    def check(variant, action) -> None:
        batch = _batch(variant)
        before = batch.get_states()
        with _refused_or_right(tally, 'action', 'Action'):
            _check_finite(batch.step(action).observation)
            before = None
        assert before is None or before == batch.get_states(), 'refused, and has moved'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(variants.ALL),
        action=st.one_of(values.ANYTHING, _BATCH_ACTIONS),
    )  # fmt: skip


def batch_resets(tally: Tally, seed: int, examples: int) -> None:
    """Resets a batch with ids, places and seeds."""
    given = {
        'ids': st.one_of(values.ANYTHING, st.lists(st.integers(-1, _ROWS), max_size=_ROWS)),
        **{name: _places(name) for name in _PLACES},
        'seed': st.one_of(values.ANYTHING, st.lists(st.integers(0, 2**64), max_size=_ROWS + 1)),
    }

    def check(variant, arguments) -> None:
        batch = _batch(variant)
        before = batch.get_states()
        with _refused_or_right(tally, *arguments, 'seeds'):
            _check_finite(batch.reset(**arguments).observation)
            before = None
        assert before is None or before == batch.get_states(), 'refused, and has changed'

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(variants.ALL), arguments=st.fixed_dictionaries({}, optional=given),
    )  # fmt: skip


def states(tally: Tally, seed: int, examples: int) -> None:
    """Restores states of which one field has been changed, single and in a batch."""
    of_generator = st.dictionaries(
        st.sampled_from(('bit_generator', 'state', 'has_uint32', 'gauss')), values.ANYTHING
    )

    def check(variant, name, value, in_part) -> None:
        env, batch = _single(variant), _batch(variant)
        kept, kept_rows = env.get_state(), batch.get_states()
        if in_part and isinstance(value, dict):
            value = {**getattr(kept, name), **value} if name == 'generator' else value
        state = dataclasses.replace(kept, **{name: value})
        for face, restore, restored in (
            (env, lambda: env.set_state(state), lambda: env.set_state(kept)),
            (batch, lambda: batch.set_states([state] * _ROWS), lambda: batch.set_states(kept_rows)),
        ):
            was_refused = True
            with _refused_or_right(tally, name, 'goal', 'State', 'state', *variations.NAMES):
                restore()
                was_refused = False
            if was_refused:
                assert kept == env.get_state(), 'refused, and has changed'
                assert kept_rows == batch.get_states(), 'refused, and has changed'
            else:
                with contextlib.suppress(control.PhysicsError):  # From a pose far away.
                    _check_finite(face.step(np.zeros(face.action_spec().shape)).observation)
            restored()

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(variants.ALL),
        name=st.sampled_from([field.name for field in dataclasses.fields(State)]),
        value=st.one_of(
            values.ANYTHING, *map(values.vectors, (3, 6, 7)),
            st.fixed_dictionaries({}, optional={'goal': values.vectors(3)}), of_generator,
        ),
        in_part=st.booleans(),
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
                'reset_mask': st.one_of(values.ANYTHING, st.lists(st.booleans(), max_size=4)),
            },
        ),
    )
    given = {'seed': values.ANYTHING, 'options': option}

    def check(face, arguments) -> None:
        env = _gymnasium(face)
        names = ('option', 'seed', 'goal', 'object_position', 'reset_mask')
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
        given = {**variant.options, name: value}
        with _refused_or_right(tally, name, *_ALSO.get(name, ())):
            env = fetch_composer.load(variant.task, seed=0, **given)
            with contextlib.closing(env):
                _check_finite(env.reset().observation)
                action = np.ones(env.action_spec().shape, np.float32)
                _check_finite(env.step(action).observation)

    _fuzz(
        seed, examples, check,
        variant=st.sampled_from(variants.ALL),
        name=names,
        value=st.one_of(
            values.ANYTHING, *map(values.vectors, (2, 3, 4, 6)), of_pixels, of_variations
        ),
    )  # fmt: skip


def explorer_options(tally: Tally, seed: int, examples: int) -> None:
    """Makes the options of a run, one of them hostile."""
    chosen = (
        'episodes', 'seed', 'num_envs', 'num_films', 'films', 'width', 'height', 'fps', 'step',
        'supersampling', 'goal', 'object_position', 'convention', 'max_episode_steps', 'noise',
        'mixture', 'dataset', 'object_shape', 'object_size', 'object_mesh',
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
    'states with a changed field': states,
    'goals of `compute_reward`': rewards,
    'options of `load`': options,
    'options of the explorer': explorer_options,
}
