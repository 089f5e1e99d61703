"""The shapes that objects of tests have."""

import numpy as np
from dm_control.composer.variation import distributions

from fetch_composer.entities import shapes

# A wedge: neither its middle nor its axes are those of its inertia.
VERTICES = np.array(
    ((0, 0, 0), (6, 0, 0), (6, 4, 0), (0, 4, 0), (0, 0, 2), (0, 4, 2)), dtype=np.float64
)
FACES = ((0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 5), (1, 5, 4), (2, 3, 5), (0, 4, 5), (0, 5, 3))


def write_obj(path, vertices, faces=FACES):
    lines = ['v {} {} {}'.format(*each) for each in vertices]
    lines += ['f {} {} {}'.format(*(i + 1 for i in each)) for each in faces]
    path.write_text('\n'.join(lines))
    return str(path)


def chosen(shape, mesh):
    return {'object_shape': shape, **({'object_mesh': mesh} if shape == 'mesh' else {})}


def drawn(mesh, choices=shapes.NAMES):
    return {
        'variations': {'object_shape': distributions.UniformChoice(choices)},
        'object_mesh': mesh,
    }


def geom_type(env):
    return shapes.NAMES[[6, 5, 3, 4, 7].index(env.physics.model.geom_type[geom(env)])]


def geom(env):
    return env.physics.bind(env.task.scene.objects[0].geom).element_id
