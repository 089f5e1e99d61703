"""What may differ from episode to episode, each drawn from a distribution of its own.

A variation is a constant, or anything that `dm_control.composer.variation` calls a variation,
such as `distributions.Uniform(low, high)`. All of them are written into the compiled model, so
that no episode costs a compilation. What is drawn for the object holds for all of a task's objects.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dm_control import mjcf
from dm_control.composer import variation

from fetch_composer.entities import arena, contact_pairs, shapes, solids
from fetch_composer.tasks import checks
from fetch_composer.tasks.scene import Scene
from fetch_composer.tasks.varied_object import VariedObject

# Name: (sizes of a drawn value, what it is).
DESCRIPTIONS = {
    'object_shape': ((1,), f"the object's shape: {', '.join(shapes.NAMES)}"),
    'object_size': ((1, 2, 3), "the object's size in m, as MuJoCo has it, or one number for all"),
    'object_mass': ((1,), "the object's mass in kg"),
    'friction': ((1,), 'sliding coefficient between the object and the table'),
    'object_color': ((3, 4), "the object's colour, RGB or RGBA in [0, 1]"),
    'light_position': ((3,), 'position in m of the light, which shines on the table'),
    'camera_offset': ((3,), "displacement in m of the arena's cameras"),
    'gripper_offset': ((3,), "displacement in m of the gripper's documented start"),
}
NAMES = tuple(DESCRIPTIONS)

_POSITIVE = frozenset({'object_size', 'object_mass', 'friction'})
_PHYSICAL = _POSITIVE | {'object_shape'}
_NEED_OBJECT = _PHYSICAL | {'object_color'}
_NEED_DOCUMENTED = ('object_shape', 'gripper_offset')
_NEED_LOOKS = frozenset({'light_position', 'camera_offset'})

# Fields of the compiled model that a variation writes.
_SIZE_FIELDS = (
    'geom_size', 'geom_rbound', 'geom_aabb', 'bvh_aabb', 'geom_quat', 'body_iquat', 'body_mass',
    'body_inertia',
)  # fmt: skip
_FIELDS = {
    'object_shape': (*_SIZE_FIELDS, 'geom_type', 'geom_dataid', 'geom_pos', 'body_ipos'),
    'object_size': _SIZE_FIELDS,
    'object_mass': ('body_mass', 'body_inertia'),
    'friction': ('geom_friction', 'pair_friction'),
    'object_color': ('mat_rgba',),
    'light_position': ('light_pos', 'light_dir'),
    'camera_offset': ('cam_pos',),
    'gripper_offset': (),
}  # fmt: skip
_NEED_SET_CONST = frozenset({'object_shape', 'object_size', 'object_mass'})


def _checked(name: str, value: Any) -> np.ndarray:
    """Returns what a variation drew, flat, in float64; a shape as the array of its name.

    Raises:
        ValueError: if it has the wrong size, is not finite, is not positive where it has to be, or
            is no shape.
    """
    if name == 'object_shape':
        return _checked_shape(value)
    found = checks.array(repr(name), value)
    sizes, description = DESCRIPTIONS[name]
    fits = checks.is_numeric(found) and found.size in sizes
    if not fits or not np.isfinite(found).all():
        raise ValueError(f'{name!r} drew {checks.shown(value)}, but it is {description}.')
    found = found.astype(np.float64)
    if name in _POSITIVE and (found <= 0).any():
        raise ValueError(f'{name!r} drew {found.tolist()}, but it must be positive.')
    if name == 'object_color' and ((found < 0) | (found > 1)).any():
        raise ValueError(f'{name!r} drew {found.tolist()}, but it is {description}.')
    return found.reshape(-1)


def _checked_shape(value: Any) -> np.ndarray:
    drawn = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    if isinstance(drawn, (tuple, list)):
        raise ValueError(
            f"'object_shape' drew {checks.shown(drawn)}, which are several; to draw one of them, "
            'give distributions.UniformChoice of dm_control.composer.variation.'
        )
    checks.one_of('object_shape', drawn, shapes.NAMES)
    return np.array([str(drawn)])


class Variations:
    """The variations of one task."""

    def __init__(self, given: Mapping | None, scene: Scene, fixed_start: bool) -> None:
        """Initializes the variations.

        Args:
            given: {name: variation}, or None for none.
            scene: The scene that they vary.
            fixed_start: Whether the convention leaves no choice of the gripper's start.

        Raises:
            ValueError: if a name is unknown or cannot be varied here.
        """
        if given is not None and not isinstance(given, Mapping):
            raise ValueError(
                f'variations must be a mapping of names, such as friction, to what is drawn; got '
                f'{checks.shown(given)}.'
            )
        self._given = dict(given or {})
        self._scene = scene
        self._objects = [VariedObject(each) for each in scene.objects]
        for name in self._given:
            if name not in DESCRIPTIONS:
                raise ValueError(
                    f'Unknown variation {checks.shown(name)}; valid are {", ".join(NAMES)}.'
                )
            if name in _NEED_OBJECT and not scene.objects:
                raise ValueError(f'{name!r} cannot vary: this task has no object.')
        for name in _NEED_DOCUMENTED:
            if fixed_start and name in self._given:
                raise ValueError(
                    f'{name!r} cannot vary in the gymnasium_robotics convention, whose start is '
                    'settled; use the documented one.'
                )
        for each in scene.objects:
            if self.vary_shape or ('object_size' in self._given and each.solid.size_turns_it):
                each.allow_any_shape()

    def __bool__(self) -> bool:
        return bool(self._given)

    def fields(
        self, expand: Callable[[str], np.ndarray], physical_only: bool = False
    ) -> dict[str, np.ndarray]:
        """Returns the fields of the compiled model that are written, by name.

        Args:
            expand: Returns a field of the model by name, (..., size of the field): () for one
                simulation and (n,) for many, each with a model of its own.
            physical_only: Whether to leave out what changes pictures alone.
        """
        names = [n for n in self._given if n in _PHYSICAL or not physical_only]
        fields = sorted({field for name in names for field in _FIELDS[name]})
        return {field: expand(field) for field in fields}

    @property
    def need_set_const(self) -> bool:
        """Whether `mj_setConst` must follow, since masses vary."""
        return not _NEED_SET_CONST.isdisjoint(self._given)

    def check_drawn(self, values: Mapping[str, np.ndarray]) -> None:
        """Raises `ValueError` if values are not such as these variations draw, by name."""
        if set(values) != set(self._given):
            raise ValueError(
                f'The state varies {", ".join(sorted(map(str, values))) or "nothing"}; this '
                f'environment varies {", ".join(sorted(self._given)) or "nothing"}.'
            )
        for name, value in values.items():
            shape = _checked(name, value).shape
            if not isinstance(value, np.ndarray) or value.shape != shape:
                raise ValueError(f'{name!r} of the state must be an array of shape {shape}.')
        self.solids(values)  # Which refuses sizes that do not fit the shape.

    def draw(self, random_state: np.random.RandomState) -> dict[str, np.ndarray]:
        """Returns {name: value} for one episode.

        Raises:
            ValueError: if a value has the wrong size, is not finite, or is not positive where
                it has to be.
        """
        return {
            name: _checked(name, variation.evaluate(source, random_state=random_state))
            for name, source in self._given.items()
        }

    @property
    def vary_looks(self) -> bool:
        """Whether light or cameras vary."""
        return not _NEED_LOOKS.isdisjoint(self._given)

    @property
    def vary_shape(self) -> bool:
        """Whether the objects' shape varies."""
        return 'object_shape' in self._given

    def compile(self, physics: mjcf.Physics) -> None:
        """Looks up what the variations write in the compiled model."""
        model = physics.model.ptr
        if self.vary_looks:
            self._light = physics.bind(self._scene.arena.light).element_id
            self._cameras = [model.camera(name).id for name in arena.CAMERAS]
            self._camera_positions = model.cam_pos[self._cameras].copy()
        self._table = physics.bind(self._scene.table.geom).element_id
        for each in self._objects:
            each.compile(physics)
        self._model, every_pair = model, np.arange(model.npair)
        usual = contact_pairs.friction(model, model.geom_friction, every_pair)
        # Pairs with a friction of their own keep it.
        self._pairs = np.flatnonzero((model.pair_friction == usual).all(axis=-1))

    def raised(self, values: Mapping[str, np.ndarray]) -> list[float]:
        """Returns by how many m each object's centre rests higher than that of the usual one."""
        if values.keys().isdisjoint(('object_shape', 'object_size')):
            return [0.0] * len(self._objects)
        return [
            float(each.solid(values).half_extents[2] - each.solid({}).half_extents[2])
            for each in self._objects
        ]

    def raised_by_shape(self, values: Mapping[str, np.ndarray]) -> list[float]:
        """Returns by how many m of that it is for their shape, whatever the size that was drawn."""
        shape = {name: value for name, value in values.items() if name == 'object_shape'}
        return self.raised(shape)

    def solids(self, values: Mapping[str, np.ndarray]) -> list[solids.Solid]:
        """Returns shape and size of each object in an episode for which values were drawn."""
        return [each.solid(values) for each in self._objects]

    def write(
        self, values: Mapping[str, np.ndarray], fields: Mapping[str, np.ndarray], row: Any = ...
    ) -> None:
        """Writes drawn values into the fields of a model.

        Args:
            values: What `draw` returned.
            fields: What `fields` returned; values that need others are not written.
            row: An index of the simulation to write to; ... if there is but one.
        """

        def field(name: str) -> np.ndarray:
            return fields[name][row]

        values = {
            name: value for name, value in values.items() if fields.keys() >= set(_FIELDS[name])
        }
        for each in self._objects:
            each.write(values, field)
            if 'object_color' in values:
                colour = values['object_color']
                field('mat_rgba')[each.material][: colour.size] = colour
        if 'friction' in values:
            friction = field('geom_friction')
            friction[[*(each.id for each in self._objects), self._table], 0] = values['friction']
            field('pair_friction')[self._pairs] = contact_pairs.friction(
                self._model, friction, self._pairs
            )
        if 'light_position' in values:
            direction = arena.aim(values['light_position'])
            field('light_pos')[self._light] = values['light_position']
            field('light_dir')[self._light] = direction / np.linalg.norm(direction)
        if 'camera_offset' in values:
            field('cam_pos')[self._cameras] = self._camera_positions + values['camera_offset']
