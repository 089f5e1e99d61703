"""How actions are chosen while learning: the policy with noise, and the relay before it."""

import dataclasses

import numpy as np

from fetch_composer.learning import networks
from fetch_composer.learning.settings import Settings
from fetch_composer.tasks import layout

# A relay ends where it was going to, or after some steps, drawn anew for each episode.
_ARRIVED = 0.015  # m
_RELAY_STEPS = (3, 30)
_RELAY_HEIGHTS = (-0.01, 0.03)  # m from the object's centre to the place that it goes to.
_RELAY_NOISE = (0.0, 0.1, 0.3)


@dataclasses.dataclass(frozen=True)
class Relay:
    """One's own policy of Reach, which brings the gripper near the object.

    It shortens what is the longest part at first: until the object is touched by accident. The
    policy is learned at the beginning of the same run, from its own episodes of Reach.

    Attributes:
        policy: What was learned of Reach.
        start: (2,) x and y in m at which the gripper starts in Reach. Other tasks have their
            robot elsewhere: places are moved by the difference.
    """

    policy: networks.Policy
    start: np.ndarray


class Explorer:
    """Chooses the actions of one episode in each environment."""

    def __init__(
        self, settings: Settings, generator: np.random.Generator, relay: Relay | None = None
    ) -> None:
        """Initializes the explorer.

        Args:
            settings: How much it explores.
            generator: Draws all that is random.
            relay: The policy of Reach, where there is an object to reach for.
        """
        self._settings = settings
        self._generator = generator
        self._relay = relay

    def begin(self, observation: np.ndarray, falling: float = 0.0) -> None:
        """Draws what holds for an episode.

        Args:
            observation: (num_envs, size) the first of each environment.
            falling: How much of its fall the noise has behind it, from 0 to 1.
        """
        # In the end some episodes show what the policy does nearly undisturbed, and others still
        # what else could be done.
        calmest = np.linspace(self._settings.final_noise, 1, len(observation))
        self._boldness = 1 - falling * (1 - calmest)
        if self._relay is None:
            return
        count, draw = len(observation), self._generator
        spread = self._settings.relay_spread
        beside = draw.uniform(-spread, spread, (count, 2))
        self._offset = np.column_stack([beside, draw.uniform(*_RELAY_HEIGHTS, count)])
        self._shift = np.zeros((count, 3))
        self._shift[:, :2] = self._relay.start - observation[:, :2]
        self._relay_noise = draw.choice(_RELAY_NOISE, (count, 1))
        self._steps_left = draw.integers(*_RELAY_STEPS, count)
        self._relaying = draw.random(count) < self._settings.relay_share
        layouts = layout.of_size(observation.shape[-1])
        at = layouts[0]
        # What Reach observes of the gripper.
        self._of_gripper = np.r_[
            at.grip_position, at.fingers, at.grip_velocity, at.finger_velocities
        ]
        starts = np.array([each.object_position.start for each in layouts])
        which = draw.integers(len(starts), size=count)
        self._of_object = starts[which][:, None] + np.arange(3)

    def act(
        self, policy: networks.Policy | None, observation: np.ndarray, goal: np.ndarray
    ) -> np.ndarray:
        """Returns (num_envs, 4) float32 actions.

        Args:
            policy: What has been learned so far; None for uniform actions.
            observation: (num_envs, size) float32
            goal: (num_envs, goal_size) float32
        """
        settings, draw = self._settings, self._generator
        shape = (len(observation), networks.ACTION_SIZE)
        action = draw.uniform(-1, 1, shape)
        if policy is not None:
            noise = settings.noise * self._boldness[:, None] * draw.standard_normal(shape)
            uniform = draw.random(len(observation)) < settings.uniform_share * self._boldness
            action = np.where(uniform[:, None], action, policy.act(observation, goal) + noise)
        if self._relay is not None:
            action = self._act_relay(action, observation)
        return np.clip(action, -1, 1).astype(np.float32)

    def _act_relay(self, action: np.ndarray, observation: np.ndarray) -> np.ndarray:
        """Returns the actions, with those of the relay where it is under way."""
        assert self._relay is not None
        place = np.take_along_axis(observation, self._of_object, axis=1) + self._offset
        way = np.linalg.norm(place - observation[:, :3], axis=1)
        self._relaying &= (self._steps_left > 0) & (way > _ARRIVED)
        self._steps_left -= 1
        if not self._relaying.any():
            return action
        seen = observation[:, self._of_gripper]
        seen[:, :3] += self._shift
        reaching = self._relay.policy.act(seen, (place + self._shift).astype(np.float32))
        reaching = reaching + self._relay_noise * self._generator.standard_normal(reaching.shape)
        reaching[:, 3] = action[:, 3]  # Reach has no use for the fingers, and knows none.
        return np.where(self._relaying[:, None], reaching, action)
