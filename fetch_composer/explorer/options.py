"""What a run is asked to do."""

import dataclasses
import functools
import pathlib
import re
from collections.abc import Sequence

from fetch_composer import policies
from fetch_composer.explorer.datasets import formats
from fetch_composer.explorer.episodes import batch_rollout, memory, origin
from fetch_composer.explorer.pictures import film
from fetch_composer.explorer.results import standard
from fetch_composer.tasks import TaskOptions, camera, checks

# Options of a task that the explorer leaves as they are: its policies see no pictures, and a
# variation is an object, which no flag can name.
NOT_EXPLORED = ('observation_mode', 'pixels', 'variations')

_UNFIT_FOR_A_NAME = re.compile(r'[^A-Za-z0-9._-]+')
_LONGEST_NAME = 40
_SEEDS = 2**64


@dataclasses.dataclass(frozen=True)
class Options:
    """What to run and how to film it.

    Each of these is a flag of the command line as well, and the text here is its help.

    Attributes:
        task: Name of the task, such as push, or one that an imported module registers.
        policy: Who acts: expert, random, zero, trained, PATH.onnx, PATH.zip of Stable-Baselines3,
            or module:function. Several are compared on the same seeds.
        noise: Standard deviation of Gaussian noise on the actions of every policy, in units of an
            action, whose range is -1 to 1.
        mixture: Policies to play an episode each, in place of policy, with their shares:
            expert:0.7,random:0.3. The seed of an episode decides which one plays it.
        task_options: Options of the task.
        episodes: Number of episodes of each policy.
        seed: Seed of the first episode; each has the next one.
        standard: Whether to make the standard evaluation: 1000 seeds that nothing is trained or
            tuned with, and no films unless you ask for them. It prints a row of a table.
        num_envs: How many episodes run at a time, on all processors; it changes none of them.
        films: Which episodes to film: worst, best, first, all or none.
        num_films: How many episodes to film of the worst, best or first.
        camera: Camera to film with, such as corner, front, side, top or close.
        width: Width of a film in pixels; without a GPU, 480x360 costs about 0.03 s a frame.
        height: Height of a film in pixels.
        supersampling: A pixel of a film is the mean of as many squared; 2 smooths edges, and
            takes twice the time.
        fps: Frames per second of a film, which has a frame for every control step; 25 is real
            time.
        trust_pickle: Whether to read a Stable-Baselines3 zip, which can run code as it is read.
        output_dir: Folder to write into; by default output/<task>_<policy>.
        ray: Ray cluster to run the episodes on: its address, or local for one of this machine.
        dataset: Dataset to write the episodes to: minari:[namespace/]name-v0 (or the name alone),
            ogbench:PATH.npz, or lerobot:DIR.
        imports: Module to import first, which registers a task of your own; it may lie in the
            working folder.
        from_state: The trajectories.npz of another run, whose filmed episodes the policy goes on
            with from a control step; choose among them with seed and episodes.
        step: The control step of from_state, from 0, from which the policy acts.
    """

    task: str = 'push'
    policy: Sequence[str] = ('expert',)
    noise: float = 0.0
    mixture: str | None = None
    task_options: TaskOptions = TaskOptions()
    episodes: int = 5
    seed: int = 0
    standard: bool = False
    num_envs: int = 64
    films: str = 'worst'
    num_films: int = 5
    camera: str = 'corner'
    width: int = 480
    height: int = 360
    supersampling: int = 1
    fps: int = 25
    trust_pickle: bool = False
    output_dir: str | None = None
    ray: str | None = None
    dataset: str | None = None
    imports: Sequence[str] = dataclasses.field(default=(), metadata={'flag': 'import'})
    from_state: str | None = None
    step: int = 0

    def check(self) -> None:
        """Raises `ValueError`, which says what is valid, if an option is out of range.

        Raises `ImportError`, which says what to install, if one needs what is not there.
        """
        for name in ('episodes', 'num_envs', 'num_films', 'supersampling'):
            checks.integer(name, getattr(self, name), 1)
        checks.integer('seed', self.seed, 0)
        self._check_size()
        self._check_origin()
        if not self.policies:
            raise ValueError('policy must name at least one.')
        if len(set(self.policies)) < len(self.policies):
            raise ValueError('policy names the same one twice; two that differ can be compared.')
        for name in NOT_EXPLORED:
            if getattr(self.task_options, name) != getattr(TaskOptions(), name):
                valid = (each.name for each in dataclasses.fields(TaskOptions))
                raise ValueError(
                    f'{name} cannot be chosen in the explorer; of a task, valid are '
                    f'{", ".join(each for each in valid if each not in NOT_EXPLORED)}.'
                )
        if self.standard:
            standard.check({**vars(self.task_options), **vars(self)})
        film.check_choice(self.films)
        film.check_format(self.width, self.height, self.fps)
        camera.check_size(self.height, self.width, self.supersampling)
        if self.ray is not None:
            from fetch_composer.explorer.episodes import ray_rollout

            ray_rollout.check_address(self.ray)
        if self.dataset is not None:
            if len(self.policies) > 1:
                raise ValueError('dataset is of one policy; give a single --policy.')
            formats.dataset(self.dataset).check(self.seeds)

    def _check_size(self) -> None:
        steps = self.task_options.max_episode_steps or 1
        fitting = memory.most_episodes(steps) // max(1, len(self.policies))
        if not fitting:
            raise ValueError(
                f'max_episode_steps is {checks.shown(steps)}, of which no episode fits into the '
                'memory of this machine.'
            )
        if self.episodes > fitting:
            raise ValueError(
                f'episodes must be at most {fitting} of {steps} steps (max_episode_steps), which '
                f'fit into the memory of this machine; got {checks.shown(self.episodes)}. Run more '
                'in several folders, each from a seed of its own.'
            )
        if self.seed + self.episodes > _SEEDS:
            raise ValueError(
                f'seed must be at most {_SEEDS - self.episodes} for {self.episodes} episodes, '
                f'whose seeds files hold in 64 bits; got {checks.shown(self.seed)}.'
            )

    def _check_origin(self) -> None:
        checks.integer('step', self.step, 0)
        if self.from_state is None:
            if self.step:
                raise ValueError('step is of from_state, which says whose step it is; give both.')
            return
        if pathlib.Path(self.from_state).resolve().is_relative_to(self.folder.resolve()):
            raise ValueError(
                f'from_state lies in {self.folder}, whose files this run would replace: choose '
                'another output_dir.'
            )

    @functools.cached_property
    def origin(self) -> origin.Origin | None:
        """What the episodes are the continuation of; None for whole ones.

        Raises:
            ValueError: if `from_state` holds no states of that step.
        """
        return None if self.from_state is None else origin.load(self.from_state, self.step)

    @functools.cached_property
    def policies(self) -> tuple[str, ...]:
        """Who acts: the names of the policies, noise included.

        Raises:
            ValueError: if noise or mixture is not valid.
        """
        names = tuple(self.policy)
        if self.mixture is not None:
            if names != type(self).policy:
                raise ValueError('mixture takes the place of policy; give one of them.')
            if not isinstance(self.mixture, str) or not policies.is_mixture(self.mixture):
                raise ValueError(
                    'mixture must name policies and their shares, such as expert:0.7,random:0.3; '
                    f'got {checks.shown(self.mixture)}.'
                )
            names = (self.mixture,)
        return tuple(policies.with_noise(each, self.noise) for each in names)

    @property
    def seeds(self) -> range:
        """The seed of each episode."""
        return range(self.seed, self.seed + self.episodes)

    @property
    def folder(self) -> pathlib.Path:
        """The folder to write into."""
        names = '_vs_'.join(file_name(policy) for policy in self.policies)
        going_on = '' if self.from_state is None else f'_from_step_{self.step}'
        return pathlib.Path(self.output_dir or f'output/{self.task}_{names}{going_on}')

    @property
    def steps(self) -> int:
        """Control steps of every episode.

        Raises:
            ValueError: if there is no end to them.
        """
        return self.of_episodes('').steps

    def of_episodes(self, policy: str) -> batch_rollout.EpisodeOptions:
        """Returns what decides on the episodes of one of the policies."""
        return batch_rollout.EpisodeOptions(
            task=self.task,
            policy=policy,
            task_options=self.task_options,
            trust_pickle=self.trust_pickle,
            imports=tuple(self.imports),
            origin=self.origin,
        )


def file_name(policy: str) -> str:
    """Returns a name for a policy that is fit for a file; two policies may share it."""
    name = _UNFIT_FOR_A_NAME.sub('_', pathlib.PurePath(policy).name).strip('.')
    return name[:_LONGEST_NAME] or 'policy'
