"""How actions are chosen while learning: a relay, then the policy with noise on action and goal."""

import numpy as np

from fetch_composer.learning import networks
from fetch_composer.learning.relay import Relay, Relays
from fetch_composer.learning.settings import Settings


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
        settings = self._settings
        # In the end some episodes show what the policy does nearly undisturbed, and others still
        # what else could be done.
        left = np.linspace(settings.final_noise, settings.last_final_noise, len(observation))
        self._boldness = 1 - falling * (1 - left)
        self._beside_goal = self._draw_beside_goal(observation)
        self._relays = None
        if self._relay is not None:
            share = settings.relay_share * self._boldness
            self._relays = Relays(self._relay, settings, share, self._generator, observation)

    def _draw_beside_goal(self, observation: np.ndarray) -> np.ndarray:
        """Returns (num_envs, goal_size) what is added to the goals that the policy sees."""
        count = len(observation)
        size = len(networks.achieved_goal_indices(observation.shape[-1]))
        beside = np.zeros((count, size // 3, 3), np.float32)
        if self._settings.goal_noise:  # Without, nothing more is drawn.
            deviation = self._settings.goal_noise * np.linspace(0, 1, count)
            along_table = self._generator.standard_normal((count, size // 3, 2))
            beside[..., :2] = deviation[:, None, None] * along_table
        return beside.reshape(count, size)

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
            chosen = policy.act(observation, goal + self._beside_goal) + noise
            action = np.where(uniform[:, None], action, chosen)
        if self._relays is not None:
            action = self._relays.act(action, observation)
        return np.clip(action, -1, 1).astype(np.float32)
