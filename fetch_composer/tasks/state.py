"""The state of an environment: everything that decides on what follows."""

import dataclasses
import functools
import hashlib
import json
import pathlib
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from fetch_composer.tasks import checks, drive
from fetch_composer.tasks.options import TaskOptions

PHYSICS = mujoco.mjtState.mjSTATE_INTEGRATION
_SEPARATOR = '/'
_MOST_STEPS = 2**31  # Which a batch can count.
_NAMES = ('task_name', 'convention', 'action_mode', 'model', 'version')

# What of a compiled model decides on motion; of geoms, only those that touch things count.
_BODY_FIELDS = (
    'body_mass', 'body_inertia', 'body_ipos', 'body_iquat', 'body_pos', 'body_quat',
    'body_gravcomp', 'jnt_type', 'jnt_range', 'jnt_axis', 'jnt_stiffness', 'dof_damping',
    'dof_armature', 'eq_data', 'eq_solref', 'eq_solimp', 'actuator_gainprm', 'actuator_ctrlrange',
)  # fmt: skip
_GEOM_FIELDS = ('geom_type', 'geom_size', 'geom_pos', 'geom_quat', 'geom_friction', 'geom_solref')


@dataclasses.dataclass(frozen=True, eq=False)
class State:
    """State of one environment, alone or in a batch; two are equal if they are to the bit.

    Attributes:
        task_name: Name of its task.
        convention: Name of its convention.
        action_mode: What its actions ask for.
        model: A digest of what of its model decides on motion.
        version: Version of MuJoCo.
        physics: MuJoCo's integration state (`mjSTATE_INTEGRATION`).
        gripper_pose: (7,) position in m and quaternion from which the next action moves the
            gripper; with a free gripper Gymnasium-Robotics reads it one substep late.
        goal: (3,) desired goal in m, or (3 n,) for n objects.
        prop_position: (2 k,) x and y in m at which each of k props started whose places are drawn.
        steps_taken: Control steps since the episode started.
        is_over: Whether the next step starts another episode.
        variations: What was drawn for this episode, by name.
        given: What was given for the next episode: `object_position`, `goal`, or neither.
        generator: State of the generator, as `numpy.random.RandomState.get_state` returns it.
    """

    task_name: str
    convention: str
    action_mode: str
    model: str
    version: str
    physics: np.ndarray
    gripper_pose: np.ndarray
    goal: np.ndarray
    prop_position: np.ndarray
    steps_taken: int
    is_over: bool
    variations: Mapping[str, np.ndarray]
    given: Mapping[str, np.ndarray]
    generator: Mapping[str, Any]

    @property
    def has_begun(self) -> bool:
        """Whether there has been an episode, for which something may have been drawn."""
        return not self.is_over or self.steps_taken > 0

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, State):
            return NotImplemented
        names = [field.name for field in dataclasses.fields(self)]
        return all(_is_same(getattr(self, name), getattr(other, name)) for name in names)

    def save(self, path: str | pathlib.Path) -> None:
        """Writes the state to an npz file, without pickles."""
        arrays: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name == 'generator':
                arrays[field.name] = json.dumps(value, default=lambda array: array.tolist())
            elif isinstance(value, Mapping):
                arrays.update({f'{field.name}{_SEPARATOR}{k}': v for k, v in value.items()})
            else:
                arrays[field.name] = value
        with open(path, 'wb') as file:
            np.savez(file, **arrays)

    @classmethod
    def load(cls, path: str | pathlib.Path) -> 'State':
        """Returns the state in a file that `save` has written.

        Raises:
            ValueError: if it holds none.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = dict(file)
            values: dict[str, Any] = {'variations': {}, 'given': {}}
            for name, array in arrays.items():
                field, _, key = name.partition(_SEPARATOR)
                if key:
                    values[field][key] = array
                else:
                    values[field] = array if array.ndim else array.item()
            values['generator'] = json.loads(values['generator'])
            return cls(**values)
        except (OSError, KeyError, TypeError, ValueError, EOFError, zipfile.BadZipFile) as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise ValueError(f'{path} does not hold the state of an environment.') from None


@dataclasses.dataclass(frozen=True)
class Identity:
    """What two environments must share for a state of one to fit the other."""

    task_name: str
    convention: str
    action_mode: str
    model: str
    version: str
    shapes: Mapping[str, tuple[int, ...]]  # Of a state's arrays.

    @functools.cached_property
    def names(self) -> dict[str, str]:
        """What a state carries of it."""
        return {name: getattr(self, name) for name in _NAMES}

    def check(self, state: State) -> None:
        """Raises `ValueError`, which says what differs, if a state is not of this identity."""
        if not isinstance(state, State):
            raise ValueError(f'A State is needed, as get_state returns it; got {state!r:.80}.')
        differing = [
            f'{name} ({checks.shown(found)}, not {needed!r})'
            for name, needed in self.names.items()
            if not isinstance(found := getattr(state, name), str) or found != needed
        ]
        if differing:
            raise ValueError(
                f'The state is of another environment: it differs in {", ".join(differing)}.'
            )
        for name, shape in self.shapes.items():
            checks.finite(f'{name} of the state', getattr(state, name), shape)
        if checks.integer('steps_taken of the state', state.steps_taken, 0) > _MOST_STEPS:
            raise ValueError(f'steps_taken of the state is more than {_MOST_STEPS}.')
        checks.boolean('is_over of the state', state.is_over)
        for name in ('variations', 'given'):
            checks.mapping(f'{name} of the state', getattr(state, name))


def identity(
    task_name: str,
    options: TaskOptions,
    model: mujoco.MjModel,
    num_goals: int,
    num_props: int,
    meshes: Sequence[int],
) -> Identity:
    """Returns the identity of an environment.

    Args:
        task_name: Name of its task.
        options: What was chosen.
        model: Its model, just compiled.
        num_goals: How many places a goal has.
        num_props: How many props there are whose places are drawn.
        meshes: Ids of the meshes that its objects are, or may become.
    """
    touching = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    digest = hashlib.sha256(np.float64(model.opt.timestep).tobytes())
    for name in _BODY_FIELDS:
        digest.update(np.ascontiguousarray(getattr(model, name)).tobytes())
    for name in _GEOM_FIELDS:
        digest.update(np.ascontiguousarray(getattr(model, name)[touching]).tobytes())
    for mesh in meshes:
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        digest.update(model.mesh_vert[first : first + count].tobytes())
    return Identity(
        task_name,
        options.convention,
        options.action_mode,
        digest.hexdigest()[:16],
        mujoco.__version__,
        shapes={
            'physics': (mujoco.mj_stateSize(model, PHYSICS),),
            'gripper_pose': (7,),
            'goal': (3 * num_goals,),
            'prop_position': (2 * num_props,),
        },
    )


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_is_same(one[each], other[each]) for each in one)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        alike = one.dtype == other.dtype and one.shape == other.shape
        return alike and one.tobytes() == other.tobytes()
    # A generator's state that was read from a file has lists in the place of arrays.
    return np.array_equal(one, other)


def copied(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns copies of arrays, by name: a state and an environment share none."""
    return {name: array.copy() for name, array in arrays.items()}


def get_physics(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Returns MuJoCo's integration state, a new array."""
    physics = np.empty(mujoco.mj_stateSize(model, PHYSICS))
    mujoco.mj_getState(model, data, physics, PHYSICS)
    return physics


def set_physics(model: mujoco.MjModel, data: mujoco.MjData, physics: np.ndarray) -> None:
    """Puts a simulation into a state, and brings positions and velocities up to date."""
    mujoco.mj_setState(model, data, np.asarray(physics, dtype=np.float64), PHYSICS)
    drive.refresh(model, data)
    mujoco.mj_camlight(model, data)
