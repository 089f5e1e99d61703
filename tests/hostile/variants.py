"""What hostile input is given to: every task in its conventions, and one in every action mode."""

import fetch_composer
from fetch_composer import tasks
from fetch_composer.tasks import action_modes

# Of two fingers that move, an object and, in modes other than the default, an arm that turns.
_IN_EVERY_MODE = 'pick_and_place'
_DEFAULT = action_modes.DISPLACEMENT.name

# (task, convention, action mode)
ALL = (
    *((task, each, _DEFAULT) for task in fetch_composer.ALL for each in tasks.conventions_of(task)),
    *((_IN_EVERY_MODE, 'documented', mode) for mode in action_modes.MODES if mode != _DEFAULT),
)
ACTION_SIZES = tuple(len(mode.components) for mode in action_modes.MODES.values())


def single(variant: tuple[str, str, str], **options):
    """Returns a single environment of a variant."""
    task, convention, mode = variant
    return fetch_composer.load(task, seed=0, convention=convention, action_mode=mode, **options)


def batch(variant: tuple[str, str, str], rows: int, **options):
    """Returns a batch of a variant."""
    task, convention, mode = variant
    return fetch_composer.BatchEnvironment(
        task, rows, seed=0, convention=convention, action_mode=mode, **options
    )
