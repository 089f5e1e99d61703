"""Ways to act that several tests share."""

import numpy as np

import fetch_composer
from fetch_composer import policies, tasks
from fetch_composer.explorer.episodes.episode import Episode


def uniform_actions(count: int, seed: int = 0, batch_shape: tuple[int, ...] = ()) -> np.ndarray:
    """Returns (count, *batch_shape, 4) float32 actions, uniform in [-1, 1]."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (count, *batch_shape, 4)).astype(np.float32)


def towards(observation, point, gain: float = 20.0) -> np.ndarray:
    """Returns the action that moves the observed gripper towards a point in m."""
    action = np.zeros(4, np.float32)
    action[:3] = np.clip(gain * (np.asarray(point) - observation['observation'][:3]), -1, 1)
    return action


def push_through(observation) -> np.ndarray:
    """Returns the action of one that gets beside the object, descends and pushes through it."""
    grip, block = observation['observation'][:3], observation['achieved_goal']
    beside = block - (0.0, 0.09, 0.0)
    if grip[2] > block[2] + 0.02 and np.abs(grip[:2] - beside[:2]).max() > 0.02:
        return towards(observation, (*beside[:2], max(grip[2], block[2] + 0.1)))
    if grip[2] > block[2] + 0.01:
        return towards(observation, beside)
    return towards(observation, (block[0] + 0.015, grip[1] + 0.025, block[2]))


def push_until(env, observation, y: float, max_steps: int = 100):
    """Pushes the object until its y, in m, is beyond that; returns the last observation."""
    for _ in range(max_steps):
        if observation['achieved_goal'][1] >= y:
            return observation
        observation = env.step(push_through(observation)).observation
    raise AssertionError(f'The object was not pushed to y = {y} m within {max_steps} steps.')


_SCALARS = ('step_type', 'reward', 'discount')

_SHARED: dict[str, fetch_composer.Environment] = {}


def shared(task_name: str, seed: int = 0, number: int = 0, **options):
    """Returns what `load` would, but not new: it has served other tests, and is seeded anew.

    It is for tests that step and reset it, and no more: to make one takes as long as a hundred
    control steps.

    Args:
        task_name: Name of the task.
        seed: Its seed.
        number: Distinguishes environments that are needed at the same time.
        **options: As for `load`.
    """
    options = {'convention': tasks.default_options(task_name).convention, **options}
    key = repr((task_name, number, sorted(options.items())))
    if key not in _SHARED:
        _SHARED[key] = fetch_composer.load(task_name, **options)
    _SHARED[key].seed(seed)
    return _SHARED[key]


def run(env, actions) -> list:
    """Returns the time steps of `env.reset()` and of every action."""
    return [env.reset(), *(env.step(action) for action in actions)]


def record(env, policy_name: str, seed: int) -> Episode:
    """Returns what a policy does in a single environment in the episode of a seed."""
    env.seed(seed)
    policy = policies.load(policy_name, env, seed=seed)
    policy.reset()
    time_steps, actions = [env.reset()], []
    while not time_steps[-1].last():
        actions.append(policy(time_steps[-1].observation))
        time_steps.append(env.step(actions[-1]))
    observations = [each.observation for each in time_steps]
    return Episode(
        seed=seed,
        **{name: np.stack([each[name] for each in observations]) for name in observations[0]},
        action=np.stack(actions),
        reward=np.array([each.reward for each in time_steps[1:]]),
        step_seconds=0.0,
    )


def assert_same(time_steps, others) -> None:
    """Asserts that two sequences of time steps, single or batched, are equal to the bit."""
    assert len(time_steps) == len(others)
    for one, other in zip(time_steps, others, strict=True):
        assert list(one.observation) == list(other.observation)
        for name, value, expected in (
            *((name, getattr(one, name), getattr(other, name)) for name in _SCALARS),
            *((name, value, other.observation[name]) for name, value in one.observation.items()),
        ):
            # To find that they are equal takes NumPy a tenth of the time.
            if not np.array_equal(value, expected):
                np.testing.assert_array_equal(value, expected, err_msg=name)
