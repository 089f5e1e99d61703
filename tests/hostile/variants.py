"""What hostile input is given to: every task in its conventions, and one in each of its options."""

import pathlib
from typing import Any, NamedTuple

from dm_control.composer.variation import distributions

import fetch_composer
from fetch_composer import tasks
from fetch_composer.entities import shapes
from fetch_composer.tasks import action_modes

# Of two fingers that move, an object and, in modes other than the default, an arm that turns.
_IN_EVERY_MODE = 'pick_and_place'
_DEFAULT = action_modes.DISPLACEMENT.name
_MESH = str(pathlib.Path(__file__).parents[1] / 'wedge.obj')


class Variant(NamedTuple):
    """A task with options.

    Attributes:
        task: Name of the task.
        convention: Name of the convention.
        action_mode: What its actions ask for.
        shape: What its object is; DRAWN for another one in each episode.
    """

    task: str
    convention: str
    action_mode: str = _DEFAULT
    shape: str | None = None

    @property
    def options(self) -> dict[str, Any]:
        """The options by name."""
        options: dict[str, Any] = {'convention': self.convention, 'action_mode': self.action_mode}
        if self.shape == DRAWN:
            options['variations'] = {'object_shape': distributions.UniformChoice(shapes.NAMES)}
        elif self.shape is not None:
            options['object_shape'] = self.shape
        if self.shape in (DRAWN, shapes.MESH):
            options['object_mesh'] = _MESH
        return options


DRAWN = 'drawn'

ALL = (
    *(Variant(task, each) for task in fetch_composer.ALL for each in tasks.conventions_of(task)),
    *(
        Variant(_IN_EVERY_MODE, 'documented', mode)
        for mode in action_modes.MODES
        if mode != _DEFAULT
    ),
    *(Variant(_IN_EVERY_MODE, 'documented', shape=each) for each in (*shapes.NAMES, DRAWN)),
)
ACTION_SIZES = tuple(len(mode.components) for mode in action_modes.MODES.values())


def single(variant: Variant, **options):
    """Returns a single environment of a variant."""
    return fetch_composer.load(variant.task, seed=0, **variant.options, **options)


def batch(variant: Variant, rows: int, **options):
    """Returns a batch of a variant."""
    return fetch_composer.BatchEnvironment(variant.task, rows, seed=0, **variant.options, **options)
