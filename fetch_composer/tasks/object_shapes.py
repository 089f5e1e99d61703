"""The shape of a task's objects, where it is chosen."""

from collections.abc import Sequence

from fetch_composer import entities
from fetch_composer.entities import shapes
from fetch_composer.tasks.options import TaskOptions


def reshape(objects: Sequence[entities.Block], options: TaskOptions) -> list[float]:
    """Gives objects the shape that was chosen, and the mesh that they may become.

    Returns:
        By how many m each is higher, from its centre down, than it was.

    Raises:
        ValueError: if there are no objects, or the mesh's file holds no solid.
    """
    shape, size = options.object_shape, options.object_size
    own = [each.half_height for each in objects]
    if shape is None and options.object_mesh is None:
        return [0.0] * len(own)
    if not objects:
        raise ValueError('object_shape was given, but this task has no object.')
    if options.object_mesh is not None:
        mesh = shapes.mesh(options.object_mesh, size if shape == shapes.MESH else None)
        for each in objects:
            if each.solid.shape == shapes.MESH:  # Of a file of its own, which this replaces.
                each.take_shape(mesh)
            else:
                each.know_mesh(mesh)
    if shape is not None:
        solid = mesh if shape == shapes.MESH else shapes.make(shape, size)
        for each in objects:
            each.take_shape(solid)
    return [each.half_height - before for each, before in zip(objects, own, strict=True)]
