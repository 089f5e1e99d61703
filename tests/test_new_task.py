"""The tasks in docs/new_task.md, run as they stand there."""

import numpy as np
import pytest

import fetch_composer
from fetch_composer import tasks
from tests import episodes, pages

_PAGE = 'new_task.md'


@pytest.fixture
def module():
    namespace: dict = {}
    exec(compile(pages.code_of(_PAGE), _PAGE, 'exec'), namespace)
    return namespace


def test_the_documented_task_runs(module):
    env = module['env']
    time_steps = episodes.run(env, episodes.uniform_actions(50))
    assert time_steps[-1].last()
    observation = time_steps[0].observation
    assert observation['desired_goal'][1] > 0.8 > observation['achieved_goal'][1]
    np.testing.assert_allclose(
        time_steps[0].observation['observation'][:3], (1.25, 0.6, 0.535), atol=1e-5
    )


def test_its_posts_stand_and_stop_the_block(module):
    env = module['env']
    block_in_front_of_a_post = (1.21, 0.65)
    env.task.set_next_episode(object_position=block_in_front_of_a_post)
    observation = env.reset().observation
    posts = [np.array(env.physics.named.data.qpos[f'post{i}/free/'][:3]) for i in range(2)]
    np.testing.assert_allclose([p[:2] for p in posts], module['_GATE'], atol=1e-6)
    for _ in range(49):
        observation = env.step(episodes.push_through(observation)).observation
    moved = env.physics.named.data.qpos['post0/free/'][:3] - posts[0]
    assert np.abs(moved).max() > 0.005  # The block pushed it.


def test_it_runs_in_a_batch(module):
    del module
    batch = fetch_composer.BatchEnvironment('push_through_gate', 2, seed=0)
    singles = [fetch_composer.load('push_through_gate', seed=i) for i in range(2)]
    batched, expected = batch.reset(), [single.reset() for single in singles]
    for _ in range(60):
        for i, each in enumerate(expected):
            np.testing.assert_allclose(
                batched.observation['observation'][i], each.observation['observation'], atol=1e-9
            )
        actions = np.array([episodes.push_through(each.observation) for each in expected])
        batched = batch.step(actions)
        expected = [s.step(a) for s, a in zip(singles, actions, strict=True)]


def test_a_name_is_given_once(module):
    assert 'push_through_gate' in fetch_composer.ALL
    with pytest.raises(ValueError, match='taken by Push'):
        tasks.register('push')(module['PushThroughGate'])
    with pytest.raises(ValueError, match='valid are documented'):
        fetch_composer.load('push_through_gate', convention='gymnasium_robotics')


def test_the_documented_puck_slides_and_the_block_stays():
    namespace: dict = {'__name__': 'documents'}  # As other tests of documents have it.
    exec(compile(pages.code_of(_PAGE, 1), _PAGE, 'exec'), namespace)
    env = namespace['two']
    env.task.set_next_episode(object_position=(1.2, 0.75, 1.4, 0.75))
    before = env.reset().observation['achieved_goal']
    for joint in env.task.scene.object_joints:
        env.physics.bind(joint).qvel[1] = 0.5  # m/s
    for _ in range(20):
        after = env.step(np.zeros(4)).observation['achieved_goal']
    puck, block = (after - before).reshape(2, 3)[:, 1]
    assert puck > 0.08 > 0.03 > block > 0
    assert env.task.options.max_episode_steps == 100
