"""What holds of the learner: continuing, files, and messages."""

import dataclasses
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

for _package in ('jax', 'optax', 'onnx', 'onnxruntime'):
    pytest.importorskip(_package, reason="needs pip install 'fetch_composer[learn]'")

import onnxruntime  # noqa: E402

import fetch_composer  # noqa: E402
from docs import make_curves  # noqa: E402
from fetch_composer import policies  # noqa: E402
from fetch_composer.learning import __main__ as command  # noqa: E402
from fetch_composer.learning import curve, networks, replay, settings, train  # noqa: E402

_ROOT = pathlib.Path(__file__).parent.parent
# Eight episodes an iteration, and networks that learn little: enough to go through all of it.
# Forty updates an iteration, also where a test has other lengths: they are compiled once for all.
_TINY = {
    'num_envs': 8,
    'environment_steps': 4 * 8 * 50,
    'random_iterations': 2,
    'updates_per_step': 0.1,
    'batch_size': 32,
    'hidden': (16, 16),
    'relay_steps': 3_200,
    'evaluate_every': 1,
    'evaluation_episodes': 8,
}


@pytest.fixture(autouse=True, scope='module')
def _few_episodes_at_the_end():
    """The thousand held-out episodes would take longer than all else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settings, 'HELD_OUT_SEEDS', range(1_000_000, 1_000_016))
        yield


@pytest.fixture(scope='module')
def pushed(tmp_path_factory):
    """A run of Push, with its relay, that nothing interrupted: folder, run and summary."""
    folder = tmp_path_factory.mktemp('pushed')
    return folder, *_run(_options(folder, 'push'))


@pytest.fixture(scope='module')
def reached(tmp_path_factory):
    """The same of Reach."""
    folder = tmp_path_factory.mktemp('reached')
    return folder, *_run(_options(folder))


def _options(folder, task='reach', **changes):
    return train.Options(
        task=task,
        convention='documented',
        seed=3,
        settings=settings.for_task(task, changes=_TINY | changes),
        minutes=None,
        output_dir=folder,
    )


def _run(options, on_progress=None):
    run = train.Run(options, on_progress)
    try:
        return run, run.run()
    finally:
        run.close()


def test_transitions_are_drawn_otherwise_in_the_second_half_of_a_run(tmp_path, monkeypatch):
    asked, sample = [], replay.HindsightReplay.sample

    def recorded(self, generator, shape, is_late):
        asked.append(is_late)
        return sample(self, generator, shape, is_late)

    monkeypatch.setattr(replay.HindsightReplay, 'sample', recorded)
    _run(_options(tmp_path, 'push', relay_share=0.0))
    assert asked == [False, True]


def test_the_policy_of_relays_has_learned_whatever_the_length_and_number_of_episodes(tmp_path):
    long = {'num_envs': 96, 'episode_steps': 100, 'updates_per_step': 0.001, 'relay_steps': 9_600}
    run = train.Run(_options(tmp_path, 'push_around', environment_steps=1, **long))
    run.close()
    steps, updates = run._relay_counts
    assert steps == 9_600 and updates == 0.25 * 50 * 64


def test_a_relay_that_waits_has_learned_nothing_and_its_run_continues(tmp_path):
    options = _options(tmp_path, 'push', relay_steps=0, relay_share=1.0)
    _run(dataclasses.replace(options, minutes=1e-6))
    run, summary = _run(options)
    assert run._relay_counts.tolist() == [0, 0] and 'Reach' not in summary['method']
    assert summary['environment_steps'] == _TINY['environment_steps']


def test_a_relay_too_short_to_learn_is_refused(tmp_path):
    with pytest.raises(ValueError, match='relay_steps must be more than 800, in which'):
        train.Run(_options(tmp_path, 'push', relay_steps=800))


def test_reach_is_learned_within_a_few_thousand_steps(tmp_path):
    shorter = {
        'environment_steps': 9_600,
        'num_envs': 32,
        'updates_per_step': 0.25,
        'hidden': (64, 64),
        'batch_size': 256,
        'evaluate_every': 3,
        'evaluation_episodes': 32,
    }
    points = []
    _, summary = _run(_options(tmp_path, **shorter), points.append)
    assert points[-1].success > 0.8
    assert summary['success_rate'] > 0.8
    assert summary['environment_steps'] == 9_600
    assert curve.load(tmp_path / 'curve.csv')[-1].success == points[-1].success
    assert (tmp_path / 'curve.png').stat().st_size > 0
    assert json.loads((tmp_path / 'summary.json').read_text()) == summary

    with fetch_composer.load('reach', seed=1_000_000) as env:
        policy = policies.load(str(tmp_path / 'policy.onnx'), env)
        time_step = env.reset()
        policy.reset()
        while not time_step.last():
            time_step = env.step(policy(time_step.observation))
    assert time_step.reward == 0


def test_an_exported_policy_acts_as_the_network_does(pushed):
    folder, run, _ = pushed
    session = onnxruntime.InferenceSession(folder / 'policy.onnx')
    shapes = {each.name: each.shape for each in (*session.get_inputs(), *session.get_outputs())}
    assert shapes == {
        'observation': ['batch', 25],
        'desired_goal': ['batch', 3],
        'action': ['batch', 4],
    }
    draw = np.random.default_rng(0)
    for rows in (1, 7):
        observation = draw.normal(1, 0.5, (rows, 25)).astype(np.float32)
        goal = draw.normal(1, 0.5, (rows, 3)).astype(np.float32)
        (action,) = session.run(None, {'observation': observation, 'desired_goal': goal})
        np.testing.assert_allclose(action, run.policy.act(observation, goal), atol=1e-5)
    with pytest.raises(ValueError, match='25'), fetch_composer.load('reach') as env:
        policies.load(str(folder / 'policy.onnx'), env)


def test_a_task_of_two_objects_is_learned_with_goals_of_both(tmp_path):
    steps = {'environment_steps': 4 * 8 * 100, 'episode_steps': 100, 'updates_per_step': 0.05}
    options = _options(tmp_path, 'stack', **steps)
    run, summary = _run(options)
    assert summary['updates'] > 0
    with fetch_composer.load('stack', seed=1_000_000) as env:
        policy = policies.load(str(tmp_path / 'policy.onnx'), env)
        observed = env.reset().observation
        policy.reset()
        action = policy(observed)
    rows = (np.float32(observed[name])[None] for name in ('observation', 'desired_goal'))
    np.testing.assert_allclose(action, run.policy.act(*rows)[0], atol=1e-5)


@pytest.mark.parametrize('task', fetch_composer.ALL)
def test_the_achieved_goal_is_found_in_the_observation(task):
    with fetch_composer.load(task, seed=0) as env:
        observed = env.reset().observation
    found = networks.achieved_goal(observed['observation'])
    np.testing.assert_array_equal(found, observed['achieved_goal'])


def test_a_run_that_is_stopped_continues_as_if_it_had_not_been(tmp_path, pushed):
    whole, _, expected = pushed

    points = []

    def stop_after_two_points(point):
        points.append(point)
        if len(points) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _run(_options(tmp_path, 'push'), stop_after_two_points)
    run, summary = _run(_options(tmp_path, 'push'))
    assert run.is_continued
    timeless = [
        {name: value for name, value in each.items() if 'minutes' not in name}
        for each in (expected, summary)
    ]
    assert timeless[0] == timeless[1]
    assert (whole / 'policy.onnx').read_bytes() == (tmp_path / 'policy.onnx').read_bytes()


def test_after_a_kill_the_same_command_goes_on_and_ends_with_a_report(tmp_path):
    flags = [f'--set={name}={_text(value)}' for name, value in _TINY.items()]
    flags += [
        '--set=environment_steps=10000000',
        '--set=num_envs=64',
        '--set=updates_per_step=0.125',
        '--set=episode_steps=5',  # So that a thousand held-out episodes are soon over.
    ]
    flags += [f'--output_dir={tmp_path}', '--task=reach']
    command = [sys.executable, '-m', 'fetch_composer.learning', *flags]
    options = {'cwd': _ROOT, 'env': {**os.environ, 'OMP_NUM_THREADS': '1'}}
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, **options)
    deadline = time.monotonic() + 60
    while not (tmp_path / 'checkpoint.npz').exists():
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    # What is left by a kill right after the checkpoint, whenever this one came.
    (tmp_path / 'curve.csv').unlink(missing_ok=True)
    (tmp_path / '.fetch_composer_part_left').mkdir()
    subprocess.run([*command, '--minutes=1e-6'], check=True, capture_output=True, **options)
    summary = json.loads((tmp_path / 'summary.json').read_text())
    points = curve.load(tmp_path / 'curve.csv')
    assert summary['environment_steps'] >= points[-1].environment_steps > 0
    assert (tmp_path / 'report' / 'report.html').is_file()
    assert not list(tmp_path.glob('.fetch_composer_part*'))


def _text(value):
    return ','.join(map(str, value)) if isinstance(value, tuple) else value


def test_time_may_end_a_run_and_more_time_continues_it(tmp_path):
    options = _options(tmp_path)
    _, summary = _run(dataclasses.replace(options, minutes=1e-6))
    assert summary['environment_steps'] == 0
    assert ' --minutes 1e-06 ' in summary['command']
    _, summary = _run(options)
    assert summary['environment_steps'] == _TINY['environment_steps']


@pytest.mark.parametrize('minutes', [1e-6, 10])
def test_a_picture_to_open_is_there(tmp_path, capsys, minutes):
    flags = [f'--set={name}={_text(value)}' for name, value in _TINY.items()]
    flags += ['--task=reach', '--no-report', f'--minutes={minutes}', f'--output_dir={tmp_path}']
    assert command.main(flags) == 0
    _, opens, path = capsys.readouterr().out.partition('open ')
    assert (tmp_path / 'curve.png').is_file() == bool(opens) == (minutes == 10)
    assert not opens or pathlib.Path(path.strip()).samefile(tmp_path / 'curve.png')


def test_networks_that_diverge_leave_the_last_good_checkpoint(tmp_path):
    run = train.Run(_options(tmp_path, environment_steps=10_000_000))
    while not run._trainer.updates:
        run._trainer.iterate()
    run._add_point()
    good = (tmp_path / 'checkpoint.npz').read_bytes()
    weights = run._trainer._learner.critics[0][0]
    weights['weight'] = weights['weight'] * np.nan
    with pytest.raises(train.DivergedError, match='learning_rate'):
        run.run()
    run.close()
    assert (tmp_path / 'checkpoint.npz').read_bytes() == good


def test_a_seed_fixes_a_run_and_another_differs(tmp_path, reached):
    again, _ = _run(_options(tmp_path / 'again'))
    other, _ = _run(dataclasses.replace(_options(tmp_path / 'other'), seed=4))
    weights, same, different = (
        np.concatenate([np.ravel(leaf) for layer in run.policy.actor for leaf in layer.values()])
        for run in (reached[1], again, other)
    )
    np.testing.assert_array_equal(weights, same)
    assert not np.allclose(weights, different)


@pytest.mark.parametrize(
    ('flags', 'message'),
    [
        (['--task=poke'], "Unknown task 'poke'; valid are "),
        (['--convention=other'], 'valid are documented, gymnasium_robotics'),
        (['--set=speed=2'], "Unknown setting 'speed'; valid are environment_steps, "),
        (['--set=hidden=wide'], 'hidden must be integers with commas'),
        (['--set=discount=1.5'], 'discount must be less than 1, got 1.5'),
        (['--set=moved_share=2'], 'moved_share must be in [0, 1], got 2.0'),
        (['--seed=-1'], 'seed must be a non-negative integer, got -1'),
        (['--minutes=0'], 'minutes must be positive and finite, got 0'),
        (['--minutes=inf'], 'minutes must be positive and finite, got inf'),
        (['--set=noise=inf'], 'noise must be finite and not negative, got inf'),
        (['--set=random_iterations=0'], 'random_iterations must be positive and finite, got 0'),
    ],
)
def test_bad_flags_are_answered_with_what_is_valid(tmp_path, capsys, flags, message):
    assert command.main([*flags, f'--output_dir={tmp_path / "run"}']) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / 'run').exists()


def test_a_folder_of_another_run_is_left_alone(reached):
    folder = reached[0]
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(ValueError, match='noise: there 0.2, here 0.1'):
        train.Run(_options(folder, noise=0.1))
    with pytest.raises(ValueError, match='seed: there 3, here 4'):
        train.Run(dataclasses.replace(_options(folder), seed=4))
    assert files == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_two_runs_do_not_share_a_folder(tmp_path):
    run = train.Run(_options(tmp_path))
    with pytest.raises(ValueError, match='Another run is at work in'):
        train.Run(_options(tmp_path))
    run.close()
    train.Run(_options(tmp_path)).close()


def test_a_file_that_is_no_checkpoint_is_named(tmp_path):
    (tmp_path / 'checkpoint.npz').write_bytes(b'not one')
    with pytest.raises(ValueError, match='checkpoint.npz cannot be read'):
        train.Run(_options(tmp_path))


def test_the_command_beside_a_curve_or_a_policy_has_all_that_is_no_default_any_more():
    runs = make_curves.learned()
    assert len(runs) > 20
    for path, summary in runs.items():
        assert tuple(summary['settings']) == settings.names(), path
        assert summary['command'] == make_curves.command(summary), f'{path}: make_curves --draw'


def test_training_tuning_and_judging_share_no_episode():
    ranges = (settings.TRAINING_SEEDS, settings.TUNING_SEEDS, range(1_000_000, 1_001_000))
    ends = [(each.start, each.stop) for each in ranges]
    assert all(one[1] <= other[0] for one, other in zip(ends, ends[1:], strict=False))
