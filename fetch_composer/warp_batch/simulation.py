"""The environments of a batch on a device: their physics, and a control step as one graph."""

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

from fetch_composer import tasks
from fetch_composer.batch import compiling
from fetch_composer.tasks import action_modes, drive, layout, observation
from fetch_composer.tasks.starts import Start
from fetch_composer.warp_batch import device_rules, kernels, physics_model, structs

_NONE = -1  # Of what a task does not have.

# What there was no room for, by the argument that makes some.
_OVERFLOWS = {
    'njmax': mjw.OverflowType.NEFC | mjw.OverflowType.NJMAX_NNZ,
    'nconmax': mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE | mjw.OverflowType.CCD,
}
_ANY_OVERFLOW = int(functools.reduce(operator.or_, _OVERFLOWS.values()))


class Simulation:
    """Physics and episodes of all environments, on one device.

    Attributes:
        environment: A single environment of the same model, which nothing steps.
        episodes: Arrays of where each environment is in its episodes.
        output: Arrays of the latest time step.
        actions: (count, 4) what the next control step is told.
        faults: (1,) bits of all that has gone wrong since they were cleared.
        data: MuJoCo Warp's data.
        observes_late: Whether positions are observed as they were one substep earlier.
    """

    def __init__(
        self, task: tasks.GoalTask, count: int, device: wp.Device, nconmax: int, njmax: int
    ) -> None:
        """Compiles the model, and allocates what is needed.

        Args:
            task: The task.
            count: How many environments.
            device: Where they are.
            nconmax: Contacts that there is room for in an environment, on average.
            njmax: Constraints that there is room for in an environment.

        Raises:
            ValueError: if the device does not have the task; the message says why.
        """
        self._rules = device_rules.of(task)
        self.environment = compiling.compiled(task)
        self._count, self._device = count, device
        self._substeps = task.physics_steps_per_control_step
        # Gymnasium-Robotics observes a free gripper one substep late.
        self.observes_late = not (task.locked_gripper or task.convention.refresh_unlocked)
        model = self.environment.physics.model.ptr
        with wp.ScopedDevice(device):
            self._model = physics_model.put(model)
            self.data = mjw.make_data(model, count, nconmax=nconmax, njmax=njmax)
            self._scene = _scene(task, model)
            self._layout = _layout(len(task.scene.objects))
            self._start = _start(task)
            self._physics = _physics(self.data)
            self.episodes = self._made_episodes()
            size = layout.of(len(task.scene.objects))[0].size
            self.output = _output(count, size)
            self.actions = wp.zeros((count, 4), dtype=float)
            self.faults = wp.zeros(1, dtype=int)
        self._graph: wp.Graph | None = None

    def _made_episodes(self) -> Any:
        """Returns episodes that are over, and puts the physics where they start."""
        made = structs.Episodes()
        for name, variable in _variables(structs.Episodes).items():
            setattr(made, name, wp.zeros(self._count, dtype=variable.type.dtype))
        made.is_over.fill_(True)
        made.given_goal.fill_(wp.vec3(wp.nan))
        made.given_place.fill_(wp.vec2(wp.nan))
        self.data.qpos.assign(np.tile(self._start.qpos.numpy(), (self._count, 1)))
        self._refresh()
        link = self._scene.gripper_link
        made.gripper_position.assign(self.data.xpos.numpy()[:, link])
        made.gripper_quaternion.assign(self.data.xquat.numpy()[:, link])
        return made

    def advance(self) -> None:
        """Takes a control step in every environment, or starts its next episode."""
        with wp.ScopedDevice(self._device):  # MuJoCo Warp computes on the current one.
            if self._device.is_cuda and self._graph is None:
                self._compile()
            if self._graph is None:
                self._control_step()
            else:
                wp.capture_launch(self._graph)

    def _compile(self) -> None:
        """Captures the control step, all kernels of which have to be compiled before."""
        saved = [wp.clone(array) for array in self._state()]
        self._control_step()
        with wp.ScopedCapture() as capture:
            self._control_step()
        for array, value in zip(self._state(), saved, strict=True):
            wp.copy(array, value)
        self._graph = capture.graph

    def _state(self) -> list[wp.array]:
        held = {
            structs.Physics: self._physics,
            structs.Episodes: self.episodes,
            structs.Output: self.output,
        }
        arrays = [
            getattr(struct, name) for kind, struct in held.items() for name in _variables(kind)
        ]
        return [*arrays, self.data.overflow, self.faults]

    def _control_step(self) -> None:
        self._launch(kernels.act, self._scene, self._physics, self.episodes, self.actions)
        for _ in range(self._substeps):
            mjw.step(self._model, self.data)
        if self.observes_late:
            self._observe(placed_only=False)
        self._launch(
            kernels.finish, self._scene, self._physics, self._rules, self._start, self.episodes
        )
        self._refresh()
        self._observe(placed_only=self.observes_late)
        self._launch(kernels.judge, self._rules, self.episodes, True, self.output)
        self._launch(kernels.tell, self.episodes, self.data.overflow, _ANY_OVERFLOW, self.faults)

    def begin(self, chosen: np.ndarray) -> None:
        """Starts an episode in each environment of a mask, (count,)."""
        with wp.ScopedDevice(self._device):
            mask = wp.array(chosen, dtype=bool)
        self._launch(
            kernels.begin, self._scene, self._physics, self._rules, self._start, self.episodes, mask
        )
        self._observe_placed()

    def observe_placed(self, placed: np.ndarray) -> None:
        """Observes environments of a mask, (count,), whose states were just written."""
        self.episodes.is_placed.assign(placed)
        self.episodes.has_started.zero_()
        self._observe_placed()

    def _observe_placed(self) -> None:
        """Observes those environments that were put in place, and rewards nobody."""
        with wp.ScopedDevice(self._device):
            self._refresh()
        self._observe(placed_only=True)
        self._launch(kernels.judge, self._rules, self.episodes, False, self.output)

    def _refresh(self) -> None:
        """Brings positions up to date with the state."""
        mjw.kinematics(self._model, self.data)
        mjw.com_pos(self._model, self.data)

    def _observe(self, placed_only: bool) -> None:
        self._launch(
            kernels.observe, self._scene, self._layout, self._physics, self.episodes, placed_only,
            self.output,
        )  # fmt: skip

    def _launch(self, kernel: wp.Kernel, *inputs: Any) -> None:
        wp.launch(kernel, dim=self._count, inputs=inputs, device=self._device)

    def take_faults(self) -> dict[str, list[int]]:
        """Returns the environments in which something went wrong, by what, and forgets it.

        That is 'actions', 'diverged', or the argument of `__init__` that was too small.
        """
        self.faults.zero_()
        faults, overflows = self.episodes.faults.numpy(), self.data.overflow.numpy()
        bits = {'actions': faults & kernels.ACTION_FAULT, 'diverged': faults & kernels.DIVERGED}
        bits |= {name: overflows & int(mask) for name, mask in _OVERFLOWS.items()}
        found = {name: np.flatnonzero(each).tolist() for name, each in bits.items() if each.any()}
        self.episodes.faults.zero_()
        self.data.overflow.zero_()
        return found


def _variables(kind: Any) -> Mapping[str, Any]:
    """Returns the variables of a kind of struct, by name."""
    return kind.vars


def _struct(kind: Any, **values: Any) -> Any:
    """Returns a struct of the device; arrays are put on the current one."""
    made = kind()
    for name, value in values.items():
        setattr(made, name, value)
    return made


def _start(task: tasks.GoalTask) -> Any:
    usual = task.starts.state(Start())
    return _struct(
        structs.Start,
        qpos=wp.array(usual.qpos, dtype=float),
        qvel=wp.array(usual.qvel, dtype=float),
        mocap_pos=wp.vec3(*usual.mocap_position),
        mocap_quat=wp.quat(*usual.mocap_quaternion),
    )


def _scene(task: tasks.GoalTask, model: mujoco.MjModel) -> Any:
    at, convention = task.addresses, task.convention
    of_grip, grip_root = observation.movers(model, at.grip_site)
    moved, of_object, object_root = _NONE, np.zeros(0, dtype=np.int64), _NONE
    if at.object_sites:
        (moved,) = at.object_sites
        of_object, object_root = observation.movers(model, moved)
    late, fixed = drive.ADDED_ROTATION, drive.FIXED_ROTATION
    return _struct(
        structs.Scene,
        gripper_link=at.gripper_link,
        mocap=at.mocap,
        grip_site=at.grip_site,
        grip_root=grip_root,
        object_site=moved,
        object_root=object_root,
        object_qpos=_first(at.object_qpos),
        fingers_qpos=_first([at.finger_qpos]),
        fingers_qvel=_first([at.finger_qvel]),
        fingers_control=_first([at.finger_control]),
        num_grip_movers=len(of_grip),
        movers=wp.array(np.concatenate((of_grip, of_object)), dtype=int),
        metres_per_unit=action_modes.METRES_PER_UNIT,
        added_rotation=wp.quat(*(late if convention.additive_rotation else fixed)),
        follows_rotation=float(convention.additive_rotation),
        loose_fingers=task.locked_gripper and not convention.rigid_lock,
        timestep=task.control_timestep,
        sense=1.0 if convention.object_minus_gripper else -1.0,
    )


def _first(places: Sequence[slice]) -> int:
    """Returns where the first place begins, unless it is empty."""
    return next((each.start for each in places if each != slice(0)), _NONE)


def _layout(count: int) -> Any:
    (found,) = layout.of(count)
    names = (name for name in found._fields if name != 'size')
    return _struct(structs.Layout, **{name: getattr(found, name).start or 0 for name in names})


def _physics(data: mjw.Data) -> Any:
    names = {name: name for name in _variables(structs.Physics) if name != 'warmstart'}
    names['warmstart'] = 'qacc_warmstart'
    return _struct(structs.Physics, **{ours: getattr(data, name) for ours, name in names.items()})


def _output(count: int, size: int) -> Any:
    made = structs.Output()
    for name, variable in _variables(structs.Output).items():
        width = {'observation': size, 'achieved_goal': 3, 'desired_goal': 3}.get(name)
        shape = (count,) if width is None else (count, width)
        setattr(made, name, wp.zeros(shape, dtype=variable.type.dtype))
    return made
