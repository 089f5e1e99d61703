"""Compiles the model of a batch."""

from fetch_composer.entities import contact_pairs
from fetch_composer.environment import Environment
from fetch_composer.tasks.goal_task import GoalTask

_OBSERVED = {'observation', 'achieved_goal', 'desired_goal'}


def compiled(task: GoalTask) -> Environment:
    """Returns a single environment whose model is without what only pictures need.

    Raises:
        ValueError: if the task observes what a batch does not.
    """
    others = set(task.task_observables) - _OBSERVED
    if others:
        raise ValueError(
            f'A batch does not observe {", ".join(sorted(others))}, which the task adds, but '
            'only what a GoalTask does; use single environments.'
        )
    task.scene.remove_looks(cameras=not task.variations.vary_looks)  # They take time.
    # Pairs have the order of the types that geoms are compiled with.
    may_have_pairs = not task.variations.vary_shape
    has_pairs = may_have_pairs and contact_pairs.name(task.root_entity.mjcf_model)
    environment = Environment(task, random_state=0)
    if has_pairs:
        contact_pairs.stop_search(environment.physics.model.ptr)
    return environment
