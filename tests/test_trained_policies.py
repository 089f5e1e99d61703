"""What holds of the policies that ship: they fit, are small, and their cards tell the truth."""

import json
import pathlib

import dm_env
import numpy as np
import pytest

import fetch_composer
from fetch_composer import policies, tasks
from fetch_composer.tasks import conventions, rewards

onnxruntime = pytest.importorskip('onnxruntime', reason="needs pip install 'fetch_composer[learn]'")

_FOLDER = pathlib.Path(policies.__file__).parent / 'trained'
_LARGEST = 300_000  # bytes
_EPISODES = 100
_FIRST_SEED = 1_000_000  # Of episodes that no policy has learned from.
_PUBLISHED = [(task, each) for task in tasks.published() for each in conventions.CONVENTIONS]
_FORMS = (*_PUBLISHED, ('push_around', 'documented'))


@pytest.fixture(params=_FORMS, ids='-'.join)
def form(request) -> tuple[str, str]:
    return request.param


@pytest.fixture
def task_name(form) -> str:
    return form[0]


@pytest.fixture
def convention(form) -> str:
    return form[1]


@pytest.fixture
def path(task_name, convention) -> pathlib.Path:
    return _FOLDER / f'{task_name}_{convention}.onnx'


@pytest.fixture
def card(path) -> dict:
    return json.loads(path.with_suffix('.json').read_text())


def test_no_other_policy_ships():
    assert {each.stem for each in _FOLDER.glob('*.onnx')} == {'_'.join(form) for form in _FORMS}


def test_each_task_has_a_small_policy_that_fits_it(path, env):
    assert path.stat().st_size <= _LARGEST
    policy = policies.load(str(path), env)
    policy.reset()
    assert policy(env.reset().observation).shape == (4,)


def test_a_card_says_how_its_policy_was_made(card, task_name, convention):
    assert (card['task'], card['convention']) == (task_name, convention)
    assert 'scratch' in card['method'] or 'imitat' in card['method']
    assert f'--task {task_name}' in card['command']
    low, high = card['success_interval']
    assert low <= card['success_rate'] <= high
    assert {'seed', 'environment_steps', 'updates', 'minutes', 'versions'} <= set(card)


def test_a_policy_succeeds_as_often_as_its_card_says(path, card, task_name, convention):
    session = onnxruntime.InferenceSession(path)
    with fetch_composer.BatchEnvironment(
        task_name, _EPISODES, seed=_FIRST_SEED, convention=convention
    ) as batch:
        time_step = batch.reset()
        while (time_step.step_type != dm_env.StepType.LAST).any():
            feed = {
                name: time_step.observation[name].astype(np.float32)
                for name in ('observation', 'desired_goal')
            }
            (actions,) = session.run(['action'], feed)
            time_step = batch.step(actions)
    reached = rewards.is_success(
        time_step.observation['achieved_goal'], time_step.observation['desired_goal']
    )
    expected = card['success_rate']
    margin = 4 * np.sqrt(expected * (1 - expected) / _EPISODES) + 1 / _EPISODES
    assert reached.mean() >= expected - margin
