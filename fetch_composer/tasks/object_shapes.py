"""The shape of a task's objects, where it is chosen."""

from collections.abc import Sequence

from fetch_composer import entities
from fetch_composer.entities import shapes
from fetch_composer.tasks.options import TaskOptions


def reshape(objects: Sequence[entities.Block], options: TaskOptions) -> None:
    """Gives objects the shape that was chosen, and the mesh that they may become.

    Raises:
        ValueError: if there are no objects, or the mesh's file holds no solid.
    """
    shape, size = options.object_shape, options.object_size
    if shape is None and options.object_mesh is None:
        return
    if not objects:
        raise ValueError('object_shape was given, but this task has no object.')
    if options.object_mesh is not None:
        mesh = shapes.mesh(options.object_mesh, size if shape == shapes.MESH else None)
        for each in objects:
            each.know_mesh(mesh)
    if shape is None:
        return
    solid = mesh if shape == shapes.MESH else shapes.make(shape, size)
    for each in objects:
        each.take_shape(solid)
