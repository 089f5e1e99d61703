"""What a run is asked to do."""

import dataclasses
import pathlib
import re
from collections.abc import Sequence

from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.pictures import film

_UNFIT_FOR_A_NAME = re.compile(r'[^A-Za-z0-9._-]+')
_LONGEST_NAME = 40


@dataclasses.dataclass(frozen=True)
class Options:
    """What to run and how to film it.

    Attributes:
        task: Name of the task.
        policy: The policies to run (see `policies.load`); several are compared on the same seeds.
        episodes: Number of episodes of each.
        seed: Seed of the first episode; each has the next one.
        convention: 'documented' or 'gymnasium_robotics'.
        reward_type: 'sparse' or 'dense'.
        max_episode_steps: Control steps of an episode.
        num_envs: How many episodes run at a time; it changes none of them.
        films: Which episodes to film, one of `film.CHOICES`.
        num_films: How many of them.
        camera: Name of a camera.
        width: Width of the film in pixels.
        height: Height of the film in pixels.
        fps: Frames per second of the film, which has a frame for every control step.
        trust_pickle: Whether code within a policy's file may run.
        output_dir: Folder to write into; None for `output/<task>_<policy>`.
        ray: 'local' or the address of a Ray cluster to run the episodes on; None for neither.
        dataset: Name of a Minari dataset to write the episodes to; None for none.
    """

    task: str
    policy: Sequence[str]
    episodes: int
    seed: int
    convention: str
    reward_type: str
    max_episode_steps: int
    num_envs: int
    films: str
    num_films: int
    camera: str
    width: int
    height: int
    fps: int
    trust_pickle: bool
    output_dir: str | None
    ray: str | None = None
    dataset: str | None = None

    def check(self) -> None:
        """Raises `ValueError`, which says what is valid, if an option is out of range.

        Raises `ImportError`, which says what to install, if one needs what is not there.
        """
        for name in ('episodes', 'num_envs', 'num_films'):
            if getattr(self, name) < 1:
                raise ValueError(f'{name} must be a positive integer, got {getattr(self, name)}.')
        if self.seed < 0:
            raise ValueError(f'seed must be a non-negative integer, got {self.seed}.')
        if not self.policy:
            raise ValueError('policy must name at least one.')
        if len(set(self.policy)) < len(self.policy):
            raise ValueError('policy names the same one twice; two that differ can be compared.')
        film.check_choice(self.films)
        film.check_format(self.width, self.height, self.fps)
        if self.ray is not None:
            from fetch_composer.explorer.episodes import ray_rollout

            ray_rollout.check_address(self.ray)
        if self.dataset is not None:
            from fetch_composer.explorer.results import minari_dataset

            if len(self.policy) > 1:
                raise ValueError('dataset is of one policy; give a single --policy.')
            minari_dataset.check_name(self.dataset)

    @property
    def seeds(self) -> range:
        """The seed of each episode."""
        return range(self.seed, self.seed + self.episodes)

    @property
    def folder(self) -> pathlib.Path:
        """The folder to write into."""
        names = '_vs_'.join(file_name(policy) for policy in self.policy)
        return pathlib.Path(self.output_dir or f'output/{self.task}_{names}')

    def of_episodes(self, policy: str) -> batch_rollout.EpisodeOptions:
        """Returns what decides on the episodes of one of the policies."""
        return batch_rollout.EpisodeOptions(
            task=self.task,
            policy=policy,
            convention=self.convention,
            reward_type=self.reward_type,
            max_episode_steps=self.max_episode_steps,
            trust_pickle=self.trust_pickle,
        )


def file_name(policy: str) -> str:
    """Returns a name for a policy that is fit for a file; two policies may share it."""
    name = _UNFIT_FOR_A_NAME.sub('_', pathlib.PurePath(policy).name).strip('.')
    return name[:_LONGEST_NAME] or 'policy'
