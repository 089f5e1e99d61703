"""Every number of the learner, and where tasks differ in them."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import fetch_composer
from fetch_composer import tasks
from fetch_composer.explorer.episodes import seeds

# Seeds of environments: to learn from, for the curve, and used once, when all is learned.
TRAINING_SEEDS, TUNING_SEEDS, HELD_OUT_SEEDS = seeds.TRAINING, seeds.TUNING, seeds.STANDARD

_SHARES = (
    'hindsight_share', 'late_hindsight_share', 'mirror_share', 'moved_share', 'lifted_share',
    'near_share', 'uniform_share', 'final_noise', 'last_final_noise', 'noise_falls_until',
    'relay_share', 'shove_share', 'grip_share',
)  # fmt: skip
_MAY_BE_ZERO = ('noise', 'goal_noise', 'action_cost', 'shift', 'relay_spread', 'relay_steps')


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides on how a task is learned; together with a seed it fixes a run.

    Attributes:
        environment_steps: Control steps, all environments together, after which a run ends.
        episode_steps: Control steps of an episode; by default as many as the task has.
        num_envs: Environments of the batch. One iteration is one episode of each, then updates.
        random_iterations: Iterations at the beginning that act at random and update nothing.
        updates_per_step: Updates of the critics for each control step.
        batch_size: Transitions of an update.
        hidden: Units of each hidden layer, in the actor and in both critics.
        learning_rate: Step size of Adam.
        final_learning_rate: What it falls to, in a straight line, over the second half of a run.
        discount: Weight of a reward one control step later.
        return_steps: Rewards that are summed before the critics' estimate of those that follow.
        target_rate: Share by which target networks approach the networks in an update.
        actor_delay: Updates of the critics for each one of the actor.
        action_cost: Weight of the mean squared action in the actor's loss.
        replay_episodes: Episodes that are kept.
        hindsight_share: Share of transitions whose goal is replaced by one achieved later.
        late_hindsight_share: What it is in the second half of a run.
        mirror_share: Share of transitions that are mirrored left to right; 0 where the scene is
            not symmetric.
        shift: Transitions are moved along the table by up to this many m, along each axis; 0 where
            something else stands on it.
        moved_share: Share of transitions that are taken from episodes that moved the object.
        lifted_share: Share of transitions that are taken from episodes that lifted it.
        near_share: Share of transitions, in the second half of a run, that are taken from moments
            at which the gripper is near the object.
        noise: Standard deviation of what is added to an action while exploring.
        goal_noise: Standard deviation in m, along each axis of the table, of what is added to the
            goal that the policy sees while exploring: 0 in the first environment, and this in the
            last.
        uniform_share: Share of actions that are drawn uniformly while exploring.
        final_noise: Share of `noise`, `uniform_share` and `relay_share` that is left in the first
            environment at the end. In each further environment they fall less.
        last_final_noise: What is left of them in the last environment.
        noise_falls_until: Part of a run at the end of which they have fallen so far, in a straight
            line from half of that part on.
        relay_share: Share of exploring episodes that begin by reaching for the object.
        shove_share: Share of relays that end in a shove: one action, towards the object, for some
            steps.
        grip_share: Share of relays that end in a grip: the fingers, open so far, close, and stay
            closed while one action is taken for some steps.
        relay_steps: Control steps for which Reach is learned before, for the relay; with 0 it waits
            where it is in place of reaching.
        relay_spread: They reach for a place up to this many m beside it.
        evaluate_every: Iterations from one point of the curve to the next.
        evaluation_episodes: Episodes of a point of the curve.
    """

    environment_steps: int = 240_000
    episode_steps: int = 50
    num_envs: int = 64
    random_iterations: int = 4
    updates_per_step: float = 0.5
    batch_size: int = 256
    hidden: tuple[int, ...] = (128, 128)
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    discount: float = 0.96
    return_steps: int = 1
    target_rate: float = 0.01
    actor_delay: int = 2
    action_cost: float = 0.05
    replay_episodes: int = 20_000
    hindsight_share: float = 0.8
    late_hindsight_share: float = 0.8
    mirror_share: float = 0.5
    shift: float = 0.1
    moved_share: float = 0.5
    lifted_share: float = 0.0
    near_share: float = 0.0
    noise: float = 0.2
    goal_noise: float = 0.0
    uniform_share: float = 0.3
    final_noise: float = 1.0
    last_final_noise: float = 1.0
    noise_falls_until: float = 1.0
    relay_share: float = 0.5
    shove_share: float = 0.6
    grip_share: float = 0.0
    relay_steps: int = 9_600
    relay_spread: float = 0.06
    evaluate_every: int = 5
    evaluation_episodes: int = 128

    def __post_init__(self) -> None:
        """Raises `ValueError`, which says what is valid, if a number is out of range."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in _SHARES:
                if not 0 <= value <= 1:
                    raise ValueError(f'{field.name} must be in [0, 1], got {value}.')
            elif field.name == 'hidden':
                if not value or min(value) < 1:
                    raise ValueError(f'hidden must name at least one layer, got {value}.')
            elif field.name in _MAY_BE_ZERO:
                if not 0 <= value < math.inf:
                    raise ValueError(f'{field.name} must be finite and not negative, got {value}.')
            elif not 0 < value < math.inf:
                raise ValueError(f'{field.name} must be positive and finite, got {value}.')
        if not self.discount < 1:
            raise ValueError(f'discount must be less than 1, got {self.discount}.')
        for first, second in (('moved_share', 'lifted_share'), ('shove_share', 'grip_share')):
            if getattr(self, first) + getattr(self, second) > 1:
                raise ValueError(f'{first} and {second} must not exceed 1 together.')
        if not self.noise_falls_until:
            raise ValueError('noise_falls_until must not be 0.')


# A grasp is a rare accident. The relay brings the open gripper right to the block, and often closes
# it there; what was lifted is rehearsed more often, and dropped less often by an action that is
# drawn.
_GRASP: dict[str, Any] = {
    'shove_share': 0.3,
    'grip_share': 0.5,
    'uniform_share': 0.1,
    'relay_spread': 0.02,
    'lifted_share': 0.2,
}

# Where a task differs from the settings above, and why.
_OF_TASK: dict[str, dict[str, Any]] = {
    # Nothing has to be found or moved: a small network and a minute are enough.
    'reach': {
        'environment_steps': 64_000,
        'updates_per_step': 0.25,
        'hidden': (64, 64),
        'random_iterations': 2,
        'mirror_share': 0.0,
        'shift': 0.0,
        'moved_share': 0.0,
        'relay_share': 0.0,
        'shove_share': 0.0,
        'evaluate_every': 2,
    },
    'push': {},
    'pick_and_place': _GRASP,
    'stack': {'environment_steps': 1_000_000, 'evaluate_every': 10, **_GRASP},
    'push_two': {'environment_steps': 1_000_000, 'evaluate_every': 10},
    # Its wall stays where it is.
    'push_around': {'environment_steps': 1_000_000, 'evaluate_every': 10, 'shift': 0.0},
    # The puck glides for most of an episode, and what it does then was decided long before: later
    # rewards weigh more, and two are summed; and a hit that may miss is not preferred to a drag
    # that takes longer. Where the puck ends depends on millimetres. So noise and relays, which
    # spoil hits, soon become few; many hits are seen for each update of the larger networks; and in
    # the end half of a batch is from where they happen. From the beginning on, that would be drags.
    # By then hits miss by little, of which goals in hindsight say nothing: these are never missed.
    # A policy that is shown a place beside the goal hits a little harder or weaker; noise of single
    # steps averages out over a hit. Relays shove from where the gripper starts: those that reached
    # for the puck before did no better.
    'slide': {
        'environment_steps': 4_000_000,
        'num_envs': 256,
        'updates_per_step': 0.05,
        'hidden': (256, 256),
        'discount': 0.985,
        'return_steps': 2,
        'replay_episodes': 50_000,
        'late_hindsight_share': 0.4,
        'near_share': 0.5,
        'goal_noise': 0.1,
        'final_noise': 0.0,
        'last_final_noise': 0.25,
        'noise_falls_until': 0.25,
        'relay_steps': 0,
        'evaluate_every': 10,
    },
}

# As few control steps as possible, whatever the time: few environments, so that what was learned is
# soon tried, and eight times as many updates.
_FRUGAL: dict[str, Any] = {
    'num_envs': 16,
    'updates_per_step': 4.0,
    'random_iterations': 2,
    'relay_steps': 3_200,
    'environment_steps': 61_600,
}
_FRUGAL_OF_TASK: dict[str, dict[str, Any]] = {
    'reach': {'environment_steps': 6_400},
    'push': {'uniform_share': 0.2},
    'pick_and_place': {'environment_steps': 96_000},
    'slide': {'environment_steps': 400_000},
}


def names() -> tuple[str, ...]:
    """Returns the names of all settings."""
    return tuple(field.name for field in dataclasses.fields(Settings))


def for_task(task: str, frugal: bool = False, changes: Mapping[str, Any] | None = None) -> Settings:
    """Returns the settings of a task.

    Args:
        task: One of `fetch_composer.ALL`; a task of one's own has the settings of Push.
        frugal: Whether to save control steps rather than time.
        changes: Settings to change, by name.

    Raises:
        ValueError: if there is no such task or setting, or a number is out of range; the message
            says what is valid.
    """
    if task not in fetch_composer.ALL:
        raise ValueError(f'Unknown task {task!r}; valid are {", ".join(fetch_composer.ALL)}.')
    changes = dict(changes or {})
    unknown = sorted(set(changes) - set(names()))
    if unknown:
        raise ValueError(
            f'Unknown setting {", ".join(map(repr, unknown))}; valid are {", ".join(names())}.'
        )
    of_episode = tasks.default_options(task).max_episode_steps or Settings.episode_steps
    chosen = {'episode_steps': of_episode, **_OF_TASK.get(task, {})}
    if frugal:
        chosen |= _FRUGAL | _FRUGAL_OF_TASK.get(task, {})
    return Settings(**chosen | changes)


def parse(text: str) -> tuple[str, Any]:
    """Returns name and value of a setting that is written as NAME=VALUE.

    Raises:
        ValueError: if it is not written so, or there is no such setting.
    """
    name, separator, value = text.partition('=')
    if not separator:
        raise ValueError(f'A setting is written as NAME=VALUE, got {text!r}.')
    if name not in names():
        raise ValueError(f'Unknown setting {name!r}; valid are {", ".join(names())}.')
    default = getattr(Settings(), name)
    try:
        if isinstance(default, tuple):
            return name, tuple(int(each) for each in value.split(','))
        return name, type(default)(value)
    except ValueError:
        kind = 'integers with commas' if isinstance(default, tuple) else type(default).__name__
        raise ValueError(f'{name} must be {kind}, got {value!r}.') from None
