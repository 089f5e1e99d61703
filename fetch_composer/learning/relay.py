"""Exploring with one's own policy of Reach: it goes to the object, and may shove or grip it.

It shortens what is the longest part at first: until the object is touched by accident, and then
until it is moved any further than an accident moves it.
"""

import dataclasses

import numpy as np

from fetch_composer.learning import networks
from fetch_composer.learning.settings import Settings
from fetch_composer.tasks import layout

# A relay ends where it was going to, or after some steps, drawn anew for each episode.
_ARRIVED = 0.015  # m
_STEPS = (3, 30)
_HEIGHTS = (-0.01, 0.03)  # m from the object's centre to the place that it goes to.
_NOISE = (0.0, 0.1, 0.3)

# A shove is one action along the table and towards the object, for some steps. Noise of single
# steps pushes to and fro; this pushes far, or hits hard.
_STEPS_BEFORE_SHOVE = 12
_STEPS_OF_SHOVE = (1, 6)
_STRENGTHS = (0.0, 1.3)  # Of the larger component; above 1 it is cut off: full strength is common.
_AIM = 0.01  # m, the standard deviation of where it aims.
# Half of those with a shove begin later, where the policy has brought the object by then.
_LATER_STEPS = 30
_LATER_SHARE = 0.5

# A grip closes the fingers, which takes some steps, and then is one action, of any direction but
# down, for some steps.
_STEPS_TO_CLOSE = 3
_STEPS_OF_GRIP = (6, 20)  # Those to close included.
_WAYS_OF_GRIP = (-1, -1, 0)  # The least of each axis; the most is 1.
_FINGERS, _OPEN, _CLOSED = 3, 1.0, -1.0
_CLOSING = np.array([0, 0, 0, _CLOSED])

# Where Reach observes the fingers.
_OBSERVED_FINGERS = np.r_[layout.WITHOUT_OBJECT.fingers, layout.WITHOUT_OBJECT.finger_velocities]


class Still:
    """A policy that stays where it is."""

    def act(self, observation: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Returns (n, 4) actions of 0."""
        del goal  # Unused.
        return np.zeros((len(observation), networks.ACTION_SIZE), np.float32)


@dataclasses.dataclass(frozen=True)
class Relay:
    """One's own policy of Reach, learned at the beginning of the same run.

    Attributes:
        policy: What was learned of Reach, or `Still`.
        start: (10,) what Reach observes as an episode begins. Other tasks have their robot
            elsewhere: places are moved by the difference. Fingers are blocked in Reach, so that
            its policy knows no others, and is always shown these.
    """

    policy: networks.Policy | Still
    start: np.ndarray


class Relays:
    """The relays of one episode in each environment."""

    def __init__(
        self,
        relay: Relay,
        settings: Settings,
        share: np.ndarray,
        generator: np.random.Generator,
        observation: np.ndarray,
    ) -> None:
        """Draws which episodes have a relay, and where it goes.

        Args:
            relay: The policy of Reach.
            settings: Where they go, and how they end.
            share: (num_envs,) how likely each episode has one.
            generator: Draws all that is random.
            observation: (num_envs, size) the first of each environment.
        """
        self._relay = relay
        self._generator = draw = generator
        count = len(observation)
        beside = draw.uniform(-settings.relay_spread, settings.relay_spread, (count, 2))
        self._offset = np.column_stack([beside, draw.uniform(*_HEIGHTS, count)])
        self._shift = np.zeros((count, 3))
        self._shift[:, :2] = relay.start[:2] - observation[:, :2]
        self._noise = draw.choice(_NOISE, (count, 1))
        steps = draw.integers(*_STEPS, count)
        self._is_due = draw.random(count) < share

        end = draw.random(count)
        self._shoves = self._is_due & (end < settings.shove_share)
        later = draw.integers(_LATER_STEPS, size=count) * (draw.random(count) < _LATER_SHARE)
        self._steps_before = np.where(self._shoves, later, 0)
        self._steps_left = np.where(self._shoves, _STEPS_BEFORE_SHOVE, steps)
        self._held_steps_left = np.zeros(count, int)
        self._held_steps = draw.integers(*_STEPS_OF_SHOVE, count)
        self._strength = draw.uniform(*_STRENGTHS, (count, 1))
        self._held = np.zeros((count, networks.ACTION_SIZE))

        layouts = layout.of_size(observation.shape[-1])
        at = layouts[0]
        # What Reach observes of the gripper.
        self._of_gripper = np.r_[
            at.grip_position, at.fingers, at.grip_velocity, at.finger_velocities
        ]
        starts = np.array([each.object_position.start for each in layouts])
        which = draw.integers(len(starts), size=count)
        self._of_object = starts[which][:, None] + np.arange(3)

        self._grips = self._is_due & ~self._shoves
        self._grips &= end < settings.shove_share + settings.grip_share
        if settings.grip_share:  # Without, nothing more is drawn.
            self._steps_left[self._grips] = _STEPS[1]
            self._held_steps[self._grips] = draw.integers(*_STEPS_OF_GRIP, count)[self._grips]
            ways = draw.uniform(_WAYS_OF_GRIP, 1, (count, 3))
            self._held[self._grips, :3] = ways[self._grips]
            self._held[self._grips, _FINGERS] = _CLOSED

    def act(self, action: np.ndarray, observation: np.ndarray) -> np.ndarray:
        """Returns (num_envs, 4) actions: those given, or a relay's where one is under way."""
        objects = np.take_along_axis(observation, self._of_object, axis=1)
        place = objects + self._offset
        way = np.linalg.norm(place - observation[:, :3], axis=1)
        reaches = self._is_due & (self._steps_before <= 0)
        self._steps_before -= 1
        arrives = reaches & ((self._steps_left <= 0) | (way <= _ARRIVED))
        self._steps_left -= reaches
        self._is_due &= ~arrives
        action = self._act_held(action, arrives, objects - observation[:, :3])
        reaches &= ~arrives
        if not reaches.any():
            return action
        seen = observation[:, self._of_gripper]
        seen[:, :3] += self._shift
        seen[:, _OBSERVED_FINGERS] = self._relay.start[_OBSERVED_FINGERS]
        reaching = self._relay.policy.act(seen, (place + self._shift).astype(np.float32))
        reaching = reaching + self._noise * self._generator.standard_normal(reaching.shape)
        # Reach has no use for the fingers, and knows none.
        reaching[:, _FINGERS] = np.where(self._grips, _OPEN, action[:, _FINGERS])
        return np.where(reaches[:, None], reaching, action)

    def _act_held(self, action: np.ndarray, begins: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Returns the actions given, or those that are held: of shoves, and of grips.

        Args:
            action: (num_envs, 4) what is done elsewhere.
            begins: (num_envs,) where a relay ends now.
            way: (num_envs, 3) in m from the gripper to the object.
        """
        shoves = begins & self._shoves
        if shoves.any():
            aim = way[:, :2] + _AIM * self._generator.standard_normal((len(way), 2))
            aim = aim / np.abs(aim).max(axis=1, keepdims=True)
            self._held[shoves, :2] = np.clip(aim * self._strength, -1, 1)[shoves]
        begins = shoves | (begins & self._grips)
        self._held_steps_left[begins] = self._held_steps[begins]
        is_held = self._held_steps_left > 0
        closes = self._grips & (self._held_steps_left > self._held_steps - _STEPS_TO_CLOSE)
        self._held_steps_left -= is_held
        held = np.where(closes[:, None], _CLOSING, self._held)
        return np.where(is_held[:, None], held, action)
