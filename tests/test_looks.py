"""What the robot looks like: one geom for each body, in the Fetch's colours."""

import numpy as np
import pytest

import fetch_composer
from fetch_composer import entities, environment, tasks
from fetch_composer.entities import looks, make_looks

_SIZE = 240  # pixels
_VISUAL_GROUP = 2


def _visual_geoms(model) -> np.ndarray:
    return np.flatnonzero(model.geom_group == _VISUAL_GROUP)


def test_a_body_wears_one_geom_at_most_which_does_not_collide(env):
    model = env.physics.model
    geoms = _visual_geoms(model)
    assert len(geoms) >= 12
    bodies = model.geom_bodyid[geoms]
    assert len(set(bodies)) == len(bodies)
    for field in (model.geom_contype, model.geom_conaffinity):
        np.testing.assert_array_equal(field[geoms], 0)
    assert (model.mesh_graphadr[model.geom_dataid[geoms]] == -1).all()  # No hulls in vain.


def test_every_look_is_worn():
    worn = set()
    for damped_base in (False, True):
        arm = entities.FetchArm(damped_base=damped_base)
        gripper = entities.FetchGripper(finger_joints=damped_base)
        for root in (arm.mjcf_model, gripper.mjcf_model):
            worn |= {geom.mesh.file.contents for geom in root.find_all('geom') if geom.mesh}
    assert worn == {look.mesh.contents for look in looks.looks().values()}


def test_the_kept_meshes_are_those_of_the_shapes():
    made = make_looks.make()
    with np.load(looks.DATA) as file:
        kept = dict(file)
    assert set(made) == set(kept)
    for key in ('names', 'palette', 'num_texels'):
        np.testing.assert_array_equal(made[key], kept[key])
    for key in ('rgba', 'specular', 'shininess'):
        np.testing.assert_allclose(made[key], kept[key], atol=1e-2)
    # Releases of MuJoCo may lay out a hull differently, but not change its extent.
    starts = [np.r_[0, np.cumsum(data['num_vertices'])[:-1]] for data in (made, kept)]
    for extreme in (np.minimum, np.maximum):
        one, other = (
            extreme.reduceat(data['vertices'], start, axis=0)
            for data, start in zip((made, kept), starts, strict=True)
        )
        np.testing.assert_allclose(one, other, atol=2)


def test_looks_can_be_removed(task_name, convention):
    task = tasks.make(task_name, convention=convention)
    task.scene.remove_looks(cameras=True)
    env = environment.Environment(task)
    assert not len(_visual_geoms(env.physics.model))
    env.close()


class _Picture:
    """Colours of each geom that a camera sees."""

    def __init__(self, convention: str, camera: str) -> None:
        pixels = {'cameras': camera, 'height': _SIZE, 'width': _SIZE, 'segmentation': True}
        env = fetch_composer.load(
            'push', seed=0, convention=convention, observation_mode='pixels', pixels=pixels
        )
        observation = env.reset().observation
        self._colours = observation[f'{camera}_rgb'].astype(int)
        self._ids = observation[f'{camera}_segmentation'][..., 0]
        self._model = env.physics.model

    def of(self, body: str) -> np.ndarray:
        """Returns (n, 3) colours of the pixels that show a link of the robot."""
        geom = self._model.name2id(f'fetch/{body}_visual', 'geom')
        colours = self._colours[self._ids == geom]
        assert len(colours) > 20
        return colours


def _is_blue(colours: np.ndarray) -> np.ndarray:
    red, _, blue = colours.T
    return (blue > 2 * red) & (blue > 60)


def _is_grey(colours: np.ndarray, darkest: int, brightest: int) -> np.ndarray:
    level = colours.mean(1)
    return (np.ptp(colours, axis=1) < 20) & (level >= darkest) & (level <= brightest)


@pytest.mark.parametrize('camera', ['corner', 'side'])
def test_the_robot_has_the_colours_of_a_fetch(convention, camera):
    picture = _Picture(convention, camera)
    assert _is_grey(picture.of('base_link'), 0, 90).mean() > 0.9
    assert _is_grey(picture.of('head_pan_link'), 0, 90).mean() > 0.9
    for link in ('shoulder_pan_link', 'upperarm_roll_link', 'forearm_roll_link'):
        assert _is_grey(picture.of(link), 70, 255).mean() > 0.9
    for link in ('shoulder_lift_link', 'elbow_flex_link', 'wrist_flex_link'):
        assert _is_blue(picture.of(link)).mean() > 0.8
    assert _is_grey(picture.of('gripper/gripper_link'), 40, 200).mean() > 0.7
    torso = picture.of('torso_lift_link')
    if convention == 'gymnasium_robotics':  # Its back is a body of its own.
        torso = np.concatenate((torso, picture.of('torso_fixed_link')))
    assert _is_grey(torso, 70, 255).mean() > 0.5
    assert _is_blue(torso).mean() > 0.1


def test_details_have_colours_of_their_own():
    with np.load(looks.DATA) as file:
        names = list(file['names'])
        texels = np.split(file['texels'], np.cumsum(file['num_vertices'])[:-1])
    colours = {name: len(set(texels[i])) for i, name in enumerate(names)}
    assert colours['base_link'] == 4  # Dark and light grey, black, and a red button.
    assert colours['torso'] == 4
    assert colours['head_tilt_link'] == 3
    assert colours['shoulder_pan_link'] == 1
