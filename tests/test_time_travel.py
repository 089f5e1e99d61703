"""`--from_state`: a policy goes on with filmed episodes of another run, from any control step."""

import numpy as np
import pytest

from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import batch_rollout
from tests import runs
from tests.test_resume import _arrays, _assert_same_results, _run, _run_stopped

_STEPS = 12
_SEEDS = (3, 4, 5)
_ARRAYS = ('observation', 'achieved_goal', 'desired_goal', 'action', 'reward')


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Returns the folder of a run of the random policy in -v4, all of whose episodes are filmed."""
    folder = tmp_path_factory.mktemp('recorded')
    values = _values(folder, 'pick_and_place')
    result = runs.explore(*(f'--{name}={value}' for name, value in values.items()), '--films=all')
    assert result.returncode == 0, result.stderr
    if 'filmed_seed' not in _arrays(folder):
        pytest.skip('no OpenGL backend works here')
    return folder


def _values(folder, task, **changes):
    small = {
        'task': task, 'policy': 'random', 'convention': 'gymnasium_robotics',
        'episodes': len(_SEEDS), 'seed': _SEEDS[0], 'max_episode_steps': _STEPS, 'num_envs': 2,
        'width': 64, 'height': 64, 'output_dir': str(folder),
    }  # fmt: skip
    return {**small, **changes}


def _options(recorded, folder, step=5, **changes):
    task = str(_arrays(recorded)['task_name'])
    path = str(recorded / 'trajectories.npz')
    values = {**_values(folder, task), 'from_state': path, 'step': step, **changes}
    values['policy'] = [values['policy']]
    return flags.make_options(values)


def test_the_states_of_filmed_episodes_are_kept(recorded):
    arrays = _arrays(recorded)
    assert sorted(arrays['filmed_seed']) == list(_SEEDS)
    assert len(arrays['physics']) == len(arrays['gripper_pose']) == len(_SEEDS)
    assert arrays['physics'].shape[1] == arrays['gripper_pose'].shape[1] == _STEPS + 1
    assert len(np.unique(arrays['physics'][0], axis=0)) == _STEPS + 1


@pytest.mark.parametrize('step', [0, 5, _STEPS - 1])
@pytest.mark.parametrize('num_envs', [1, 4])
def test_the_same_policy_goes_on_to_the_same_end_to_the_bit(recorded, tmp_path, step, num_envs):
    """Even one that draws: it is shown what was before, and so has drawn as often."""
    options = _options(recorded, tmp_path, step=step).of_episodes('random')
    before = _arrays(recorded)
    for i, each in enumerate(batch_rollout.run_episodes(options, _SEEDS, num_envs)):
        for name in _ARRAYS:
            np.testing.assert_array_equal(getattr(each, name), before[name][i], err_msg=name)


def test_another_policy_acts_from_that_step_on(recorded, tmp_path):
    options = _options(recorded, tmp_path, step=5).of_episodes('zero')
    before = _arrays(recorded)
    for i, each in enumerate(batch_rollout.run_episodes(options, _SEEDS)):
        np.testing.assert_array_equal(each.action[:5], before['action'][i][:5])
        np.testing.assert_array_equal(each.observation[:6], before['observation'][i][:6])
        assert (each.action[5:] == 0).all() and len(each.action) == _STEPS
        assert (each.observation[-1] != before['observation'][i][-1]).any()


def test_a_run_that_is_stopped_is_continued_to_the_same_result(recorded, tmp_path):
    stopped, whole = (_options(recorded, tmp_path / each) for each in ('stopped', 'whole'))
    _run_stopped(stopped, after=2)
    with pytest.raises(ValueError, match='differs in from_state'):
        _run(_options(recorded, tmp_path / 'stopped', step=6))
    assert _run(stopped).continued == 2
    _run(whole)
    _assert_same_results(stopped.folder, whole.folder)


def test_what_cannot_be_gone_on_with_is_refused_and_nothing_is_written(recorded, tmp_path):
    folder = tmp_path / 'new'
    refused = [
        (_options(recorded, folder, seed=4), 'holds the states of the seeds'),
        (_options(recorded, folder, step=_STEPS), f'step must be from 0 to {_STEPS - 1}'),
        (_options(recorded, folder, task='reach'), r'differs in task_name \(\w+, not reach\)'),
        (_options(recorded, folder, convention='documented'), 'differs in convention'),
        (_options(recorded, folder, goal=(1.3, 0.7, 0.45)), 'seed 3 starts .desired_goal'),
        (_options(recorded, folder, from_state='nowhere.npz'), 'nowhere.npz is not there'),
        (_options(recorded, recorded), 'whose files this run would replace'),
        (runs.options(step=3, output_dir=str(folder)), 'give both'),
    ]
    for options, message in refused:
        with pytest.raises(ValueError, match=message):
            run_lib.Run(options, None)
    assert not folder.exists()


def test_a_run_without_films_holds_no_states(tmp_path):
    options = runs.options(output_dir=str(tmp_path / 'first'))
    _run(options)
    path = tmp_path / 'first' / 'trajectories.npz'
    other = runs.options(from_state=str(path), step=1, output_dir=str(tmp_path / 'second'))
    with pytest.raises(ValueError, match='of a run with films'):
        run_lib.Run(other, None)
