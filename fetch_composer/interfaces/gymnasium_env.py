"""The tasks as Gymnasium environments: one at a time, or a native batch of them.

`-v2` ids follow the documented convention; `-v4` ids are drop-in replacements for the v4
environments of Gymnasium-Robotics.
"""

import threading
from typing import Any

import numpy as np

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise ImportError(
        "The Gymnasium adapter needs Gymnasium: pip install 'fetch_composer[gymnasium]'."
    ) from error

from fetch_composer import suite, tasks
from fetch_composer.batch import BatchEnvironment

NAMESPACE = 'fetch_composer'
_VERSIONS = {'v2': 'documented', 'v4': 'gymnasium_robotics'}
_REWARD_SUFFIXES = {'': 'sparse', 'Dense': 'dense'}

_RENDER_MODES = ('human', 'rgb_array', 'depth_array')
_FRAMES_PER_SECOND = 25
_RESET_OPTIONS = ('object_position', 'goal')


def _space(spec) -> spaces.Box:
    """Returns the space of one observation: pictures are bytes, all else is unbounded."""
    if spec.dtype == np.uint8:
        return spaces.Box(0, 255, spec.shape, np.uint8)
    if np.issubdtype(spec.dtype, np.integer):
        return spaces.Box(
            np.iinfo(spec.dtype).min, np.iinfo(spec.dtype).max, spec.shape, spec.dtype
        )
    return spaces.Box(-np.inf, np.inf, spec.shape, spec.dtype.type)


def _spaces(action_spec, observation_spec) -> tuple[spaces.Box, spaces.Dict]:
    """Returns action and observation space of one environment."""
    action_space = spaces.Box(-1.0, 1.0, action_spec.shape, np.float32)
    return action_space, spaces.Dict({k: _space(spec) for k, spec in observation_spec.items()})


def _check_options(options: dict[str, Any] | None) -> dict[str, Any]:
    """Returns the options of a reset.

    Raises:
        ValueError: if one is unknown; the message lists the valid ones.
    """
    options = options or {}
    unknown = sorted(set(options) - set(_RESET_OPTIONS))
    if unknown:
        raise ValueError(
            f'Unknown option {", ".join(map(repr, unknown))}; valid are '
            f'{", ".join(_RESET_OPTIONS)}.'
        )
    return options


class _GoalFunctions:
    """Reward, termination and truncation as functions of goals, for hindsight relabelling."""

    _reward_type: str

    def compute_reward(self, achieved_goal, desired_goal, info) -> np.ndarray:
        """Returns the reward of goals of shape (..., 3); float64, shape (...,)."""
        del info  # Unused.
        return tasks.compute_reward(achieved_goal, desired_goal, self._reward_type)

    def compute_terminated(self, achieved_goal, desired_goal, info) -> bool:
        """Returns False: the tasks are continuing."""
        del achieved_goal, desired_goal, info  # Unused.
        return False

    def compute_truncated(self, achieved_goal, desired_goal, info) -> bool:
        """Returns False: only the number of steps truncates an episode."""
        del achieved_goal, desired_goal, info  # Unused.
        return False


class FetchEnv(_GoalFunctions, gymnasium.Env, gymnasium.utils.EzPickle):
    """One task as a goal-aware `gymnasium.Env`."""

    metadata = {'render_modes': list(_RENDER_MODES), 'render_fps': _FRAMES_PER_SECOND}

    def __init__(
        self,
        task: str,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        camera_name: str = 'corner',
        **task_kwargs,
    ) -> None:
        """Initializes the environment.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            render_mode: 'rgb_array' for (height, width, 3) uint8 images, 'depth_array' for
                (height, width) float32 distances in m, 'human' for a window, or None.
            width: Width of images in pixels.
            height: Height of images in pixels.
            camera_name: A camera of the model, such as 'front' or 'fetch/head_camera'.
            **task_kwargs: Options of the task; see `tasks.GoalTask`.

        Raises:
            ValueError: if an argument is not valid; the message lists what is.
        """
        gymnasium.utils.EzPickle.__init__(
            self, task, render_mode, width, height, camera_name, **task_kwargs
        )
        if render_mode is not None and render_mode not in _RENDER_MODES:
            raise ValueError(
                f'Unknown render_mode {render_mode!r}; valid are {", ".join(_RENDER_MODES)}.'
            )
        # Truncation is up to Gymnasium's own wrapper, so that `gym.make` can change it.
        task_kwargs.setdefault('max_episode_steps', None)
        self._env: Any = suite.load(suite.DOMAIN, task, task_kwargs)
        self._reward_type = self._env.task.reward_type
        self.action_space, self.observation_space = _spaces(
            self._env.action_spec(), self._env.observation_spec()
        )
        self.render_mode = render_mode
        self._size = {'height': height, 'width': width}
        self._camera = self._checked_camera(camera_name)
        self._viewer: Any = None

    def _checked_camera(self, name: str) -> str:
        model = self._env.physics.model
        names = [model.id2name(i, 'camera') for i in range(model.ncam)]
        if name not in names:
            raise ValueError(f'Unknown camera_name {name!r}; valid are {", ".join(names)}.')
        return name

    @property
    def dm_env(self):
        """The `composer.Environment` behind this one."""
        return self._env

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode.

        Args:
            seed: If given, the episode and those that follow are those of this seed.
            options: `object_position`, (2,) x and y in m, and `goal`, (3,) in m, where they are
                not to be sampled.

        Raises:
            ValueError: if an option is unknown or a place cannot be; nothing has changed.
        """
        self._env.task.set_next_episode(**_check_options(options))
        super().reset(seed=seed)
        # One generator serves both faces, so that the task draws from `self.np_random`.
        self._env.seed(np.random.RandomState(self.np_random.bit_generator))
        time_step = self._env.reset()
        if self.render_mode == 'human':
            self.render()
        return dict(time_step.observation), self._info()

    def step(self, action):
        """Advances one control step of 0.04 s.

        Args:
            action: (4,) displacement of the gripper in units of 0.05 m, and its opening.

        Raises:
            ValueError: if the action has another shape or is not finite; nothing has changed.
        """
        time_step = self._env.step(action)
        if self.render_mode == 'human':
            self.render()
        observation, info = dict(time_step.observation), self._info()
        return observation, time_step.reward, False, time_step.last(), info

    def _info(self) -> dict[str, Any]:
        return {'is_success': float(self._env.task.is_success())}

    def render(self):
        """Returns a picture as the render mode asks, or None for 'human' and for no mode."""
        if self.render_mode == 'human':
            self._show()
            return None
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() needs a render_mode, such as gym.make(..., render_mode="rgb_array").'
            )
            return None
        depth = self.render_mode == 'depth_array'
        return self._env.physics.render(camera_id=self._camera, depth=depth, **self._size)

    def _show(self) -> None:
        if self._viewer is None:
            import glfw
            import mujoco.viewer

            # MuJoCo's viewer ends the process if there is no display.
            if not glfw.init():
                raise RuntimeError(
                    "render_mode='human' opens a window and needs a display; without one use "
                    "'rgb_array', or explore.py, which renders to files."
                )
            physics, threads = self._env.physics, set(threading.enumerate())
            self._viewer = mujoco.viewer.launch_passive(physics.model.ptr, physics.data.ptr)
            self._viewer.cam.lookat[:] = self._env.task.workspace.table_position
            self._viewer.cam.distance, self._viewer.cam.azimuth = 2.5, 132
            self._viewer_threads = set(threading.enumerate()) - threads
        self._viewer.sync()

    def close(self) -> None:
        """Closes the window, if there is one, and frees the simulation."""
        if self._viewer is not None:
            self._viewer.close()
            for thread in self._viewer_threads:  # They draw from memory that is freed below.
                thread.join()
            self._viewer = None
        if self._env is not None:
            self._env.close()
            self._env = None


class FetchVectorEnv(_GoalFunctions, gymnasium.vector.VectorEnv):
    """Many environments of one task on native threads, as a `gymnasium.vector.VectorEnv`.

    A finished environment starts its next episode in the following call of `step`.
    """

    metadata = {
        'render_modes': [],
        'render_fps': _FRAMES_PER_SECOND,
        'autoreset_mode': gymnasium.vector.AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, task: str, num_envs: int, num_threads: int | None = None, **task_kwargs
    ) -> None:
        """Initializes the environments.

        Args:
            task: Name of the task, one of `fetch_composer.ALL`.
            num_envs: How many environments.
            num_threads: Threads that share them; by default one for each processor.
            **task_kwargs: Options of the task; see `tasks.GoalTask`.

        Raises:
            ValueError: if an argument is not valid; the message lists what is.
        """
        self._batch = BatchEnvironment(task, num_envs, num_threads, **task_kwargs)
        self.num_envs = num_envs
        self._reward_type = self._batch.task.reward_type
        self.single_action_space, self.single_observation_space = _spaces(
            self._batch.single_action_spec(), self._batch.single_observation_spec()
        )
        batch_space = gymnasium.vector.utils.batch_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    @property
    def batch(self) -> BatchEnvironment:
        """The `BatchEnvironment` behind these."""
        return self._batch

    def reset(self, *, seed=None, options: dict[str, Any] | None = None):
        """Starts an episode in every environment.

        Args:
            seed: If given, environment i is seeded with seed + i; or one seed for each.
            options: `object_position`, (2,) or (num_envs, 2) in m, and `goal`, (3,) or
                (num_envs, 3) in m, where they are not to be sampled.

        Raises:
            ValueError: if an option is unknown or a place cannot be; nothing has changed.
        """
        starts = self._batch.check_starts(**_check_options(options))
        if seed is not None:
            self._batch.seed(seed)
            if isinstance(seed, (int, np.integer)):
                super().reset(seed=int(seed))
        time_step = self._batch.start_episodes(starts)
        return time_step.observation, self._info(time_step)

    def step(self, actions):
        """Advances every environment by one control step; see `BatchEnvironment.step`."""
        time_step = self._batch.step(actions)
        terminated = np.zeros(self.num_envs, dtype=bool)
        truncated = time_step.step_type == 2
        return (
            time_step.observation,
            time_step.reward,
            terminated,
            truncated,
            self._info(time_step),
        )

    def _info(self, time_step) -> dict[str, np.ndarray]:
        achieved, desired = (time_step.observation[k] for k in ('achieved_goal', 'desired_goal'))
        return {
            'is_success': tasks.is_success(achieved, desired).astype(np.float64),
            '_is_success': np.ones(self.num_envs, dtype=bool),
        }

    def close_extras(self, **unused_kwargs) -> None:
        """Frees the simulations."""
        self._batch.close()


def _camel_case(task_name: str) -> str:
    return ''.join(word.capitalize() for word in task_name.split('_'))


def env_id(task: str, convention: str = 'documented', reward_type: str = 'sparse') -> str:
    """Returns the id under which Gymnasium knows a task."""
    suffix = {reward: each for each, reward in _REWARD_SUFFIXES.items()}[reward_type]
    version = {each: version for version, each in _VERSIONS.items()}[convention]
    return f'{NAMESPACE}/Fetch{_camel_case(task)}{suffix}-{version}'


def register() -> None:
    """Registers every task under both conventions and both rewards."""
    for task in tasks.ALL:
        for reward_type in _REWARD_SUFFIXES.values():
            for convention in _VERSIONS.values():
                gymnasium.register(
                    id=env_id(task, convention, reward_type),
                    entry_point='fetch_composer.interfaces.gymnasium_env:FetchEnv',
                    vector_entry_point='fetch_composer.interfaces.gymnasium_env:FetchVectorEnv',
                    max_episode_steps=tasks.MAX_EPISODE_STEPS,
                    kwargs={'task': task, 'reward_type': reward_type, 'convention': convention},
                )


register()
