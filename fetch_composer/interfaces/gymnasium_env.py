"""One task as a Gymnasium environment.

`-v2` ids follow the documented convention; `-v4` ids are drop-in replacements for the v4
environments of Gymnasium-Robotics.
"""

import threading
import time
from typing import Any

import mujoco
import numpy as np

from fetch_composer import suite
from fetch_composer.interfaces import gymnasium_common
from fetch_composer.interfaces.gymnasium_common import gymnasium
from fetch_composer.tasks import camera, checks, rewards, seeding
from fetch_composer.tasks.state import State

_RENDER_MODES = ('human', 'rgb_array', 'depth_array')


class FetchEnv(gymnasium_common.GoalFunctions, gymnasium.Env, gymnasium.utils.EzPickle):
    """One task as a goal-aware `gymnasium.Env`."""

    metadata = {'render_modes': list(_RENDER_MODES), 'render_fps': gymnasium_common.RENDER_FPS}

    def __init__(
        self,
        task: str,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        camera_name: str = 'corner',
        supersampling: int = 1,
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
            supersampling: A pixel is the mean of as many squared: 2 smooths edges.
            **task_kwargs: Options of the task; see `tasks.TaskOptions`. An episode is truncated
                only if `max_episode_steps` is given here, or by `gym.make`.

        Raises:
            ValueError: if an argument is not valid; the message lists what is.
        """
        gymnasium.utils.EzPickle.__init__(
            self, task, render_mode, width, height, camera_name, supersampling, **task_kwargs
        )
        if render_mode is not None:
            checks.one_of('render_mode', render_mode, _RENDER_MODES)
        # As with any environment of Gymnasium, `gym.make` limits an episode, and nothing else.
        task_kwargs.setdefault('max_episode_steps', None)
        self._env: Any = suite.load(suite.DOMAIN, task, task_kwargs)
        self._task_options = self._env.task.options
        self.action_space, self.observation_space = gymnasium_common.spaces_of(
            self._env.action_spec(), self._env.observation_spec()
        )
        self.render_mode = render_mode
        camera.check_name(self._env.physics, camera_name)
        self._share_generator()
        self._picture: dict[str, Any] = {
            'name': camera_name,
            **gymnasium_common.picture_options(width, height, supersampling),
        }
        self._camera: camera.Camera | None = None
        self._viewer: Any = None
        self._shown_at = 0.0

    @property
    def dm_env(self):
        """The `composer.Environment` behind this one."""
        return self._env

    # -- What code written against Gymnasium-Robotics looks for ----------------------------------

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model."""
        return self._open_env.physics.model.ptr

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        return self._open_env.physics.data.ptr

    @property
    def goal(self) -> np.ndarray:
        """(3,), or (3 n,) for n objects: desired goal of the present episode in m."""
        return self._open_env.task.goal

    @property
    def distance_threshold(self) -> float:
        """Distance in m below which a goal is achieved."""
        return rewards.DISTANCE_THRESHOLD

    @property
    def reward_type(self) -> str:
        """'sparse' or 'dense'."""
        return self._task_options.reward_type

    @property
    def dt(self) -> float:
        """Seconds from one control step to the next."""
        return self._open_env.control_timestep()

    # ----------------------------------------------------------------------------------------------

    @property
    def _open_env(self):
        self._check_open()
        return self._env

    def _check_open(self) -> None:
        if self._env is None:
            raise RuntimeError('This environment is closed; make another.')

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode.

        Args:
            seed: If given, the episode and those that follow are those of this seed.
            options: `object_position`, (2,) x and y in m, and `goal`, (3,) in m, where they are
                not to be sampled; with several objects, two and three numbers for each.

        Raises:
            ValueError: if an option is unknown or a place cannot be; nothing has changed.
        """
        self._check_open()
        seed = seeding.check_seed(seed)
        options = gymnasium_common.check_options(options)
        if options:  # Otherwise there may be what a state has brought.
            self._env.task.set_next_episode(**options)
        super().reset(seed=seed)
        self._share_generator()
        time_step = self._env.reset()
        if self.render_mode == 'human':
            self.render()
        return dict(time_step.observation), self._info()

    def step(self, action):
        """Advances one control step of 0.04 s.

        Args:
            action: As the action space says; by default (4,), displacement of the gripper in units
                of 0.05 m and its opening.

        Raises:
            ValueError: if the action has another shape or is not finite; nothing has changed.
            RuntimeError: if the episode has ended, or none has begun.
        """
        self._check_open()
        if self._env.is_over:
            raise RuntimeError('The episode has ended, or none has begun: call reset() first.')
        time_step = self._env.step(action)
        if self.render_mode == 'human':
            self.render()
        terminated = time_step.last() and time_step.discount == 0
        truncated = time_step.last() and (not terminated or self._env.task.is_truncated())
        observation, info = dict(time_step.observation), self._info()
        return observation, time_step.reward, terminated, truncated, info

    def _share_generator(self) -> None:
        """Lets the task draw from `self.np_random`: one generator serves both faces."""
        self._env.seed(np.random.RandomState(self.np_random.bit_generator))

    def _info(self) -> dict[str, Any]:
        return {'is_success': np.float32(self._env.task.is_success())}

    def get_state(self) -> State:
        """Returns everything that decides on what follows, but for Gymnasium's wrappers."""
        self._check_open()
        return self._env.get_state()

    def set_state(self, state: State) -> None:
        """Restores a state; see `Environment.set_state`."""
        self._check_open()
        self._env.set_state(state)

    def render(self):
        """Returns a picture as the render mode asks, or None for 'human' and for no mode."""
        self._check_open()
        if self.render_mode == 'human':
            self._show()
            return None
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() needs a render_mode, such as gym.make(..., render_mode="rgb_array").'
            )
            return None
        physics = self._env.physics
        if self._camera is None or self._camera.physics is not physics:
            self._camera = camera.Camera(physics, **self._picture)
        if self.render_mode == 'depth_array':
            return self._camera.depth()
        return self._camera.picture()

    def _show(self) -> None:
        if self._viewer is None:
            import glfw
            from mujoco import viewer

            # MuJoCo's viewer ends the process if there is no display.
            if not glfw.init():
                raise RuntimeError(
                    "render_mode='human' opens a window and needs a display; without one use "
                    "'rgb_array', or explore.py, which renders to files."
                )
            physics, threads = self._env.physics, set(threading.enumerate())
            self._viewer = viewer.launch_passive(physics.model.ptr, physics.data.ptr)
            self._viewer.cam.lookat[:] = self._env.task.workspace.table_position
            self._viewer.cam.distance, self._viewer.cam.azimuth = 2.5, 132
            self._viewer_threads = set(threading.enumerate()) - threads
        # An episode plays in real time.
        wait = self._shown_at + 1 / gymnasium_common.RENDER_FPS - time.perf_counter()
        if wait > 0:
            time.sleep(wait)
        self._shown_at = time.perf_counter()
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
