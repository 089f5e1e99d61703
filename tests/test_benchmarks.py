"""The benchmarks work and say what they measured. Nothing here depends on how fast anything is."""

import json
import os
import subprocess
import sys

import pytest

from benchmarks import meters, pairing, report, results, rows

_PEER = rows.GYMNASIUM_ROBOTICS


@pytest.fixture(scope='module')
def quick(tmp_path_factory):
    """Returns what a quick run printed, and the directory it wrote to."""
    output_dir = tmp_path_factory.mktemp('bench')
    command = [sys.executable, '-m', 'benchmarks', '--quick', '--output_dir', str(output_dir)]
    run = subprocess.run(
        command, cwd=meters.ROOT, env=dict(os.environ), capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    return run.stdout, output_dir


@pytest.fixture(scope='module')
def quick_results(quick):
    return json.loads((quick[1] / 'results.json').read_text(encoding='utf-8'))


def test_every_row_is_measured(quick_results):
    assert len(quick_results['rows']) == len(rows.quick_rows())
    for row in quick_results['rows']:
        assert 'skipped' not in row
        assert row['our_cost'] > 0
        assert row['peer_cost'] > 0


def test_quartiles_are_those_of_the_numbers():
    quartiles = pairing.Quartiles.of([40, 10, 30, 20, 50])
    assert (quartiles.lower, quartiles.median, quartiles.upper) == (20, 30, 40)


def test_goals_are_judged(quick_results):
    for row in quick_results['rows']:
        assert (row['goal'] is None) == (row['reached'] is None)


def test_a_control_step_is_taken_apart(quick_results):
    breakdowns = quick_results['breakdowns']
    assert [each['label'] for each in breakdowns] == ['documented', 'documented, batch of 64']
    single, batch = (set(each['parts']) for each in breakdowns)
    assert {'physics', 'observation', 'refresh of kinematics'} <= single
    assert {'validation, action', 'observation', 'physics, refresh of kinematics'} <= batch
    for breakdown in breakdowns:
        parts = breakdown['parts']
        assert all(0 < time < breakdown['whole'] for time in parts.values())


def test_the_table_has_a_line_for_every_row(quick):
    for row in rows.quick_rows():
        assert any(row.ours.label in line and row.peer.label in line
                   for line in quick[0].splitlines())  # fmt: skip


def test_growth_has_a_point_for_every_number_of_environments(quick_results):
    sizes: dict[str, list[int]] = {}
    for point in quick_results['growth']:
        sizes.setdefault(point['label'], []).append(point['num_envs'])
    assert sizes == {'fetch_composer': [1, 8], 'bare mujoco.rollout': [1, 8]}


def test_the_plot_is_a_picture(quick):
    assert (quick[1] / 'num_envs.png').read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize('path', (None, '/no/such/python'))
def test_a_peer_that_is_not_installed_is_skipped_visibly(path):
    row = next(row for row in rows.all_rows() if row.peer.interpreter == _PEER)
    result = results.measure_row(row, meters.Interpreters({_PEER: path}), 1, 0)
    assert _PEER in result['skipped']
    assert 'SKIPPED' in report.table({'rows': [result]})


def test_ray_is_skipped_visibly_where_it_is_missing(monkeypatch):
    monkeypatch.setattr(meters.importlib.util, 'find_spec', lambda name: None)
    result = results.measure_row(rows.ray_row(), meters.Interpreters(), 1, 0)
    assert result['skipped'] == 'ray is not installed'
    assert 'SKIPPED' in report.table({'rows': [result]})


def test_a_peer_that_fails_is_skipped_and_says_why():
    row = rows.Row(
        'single',
        meters.WholeProcess('ours', meters.OWN, 'pass'),
        meters.WholeProcess('peer', _PEER, 'raise SystemExit("no robots here")'),
        'time',
    )
    result = results.measure_row(row, meters.Interpreters({_PEER: sys.executable}), 1, 0)
    assert 'no robots here' in result['skipped']


def test_a_ratio_of_speeds_grows_and_one_of_times_shrinks_as_ours_gets_faster():
    side = meters.WholeProcess('side', meters.OWN, 'pass')
    speed = rows.Row('single', side, side, 'speed', goal=2.0)
    time = rows.Row('reset', side, side, 'time', goal=1.0)
    assert speed.ratio(ours=1.0, peer=3.0) == 3.0
    assert speed.reached(3.0) and not speed.reached(1.9)
    assert time.ratio(ours=1.0, peer=4.0) == 0.25
    assert time.reached(0.25) and not time.reached(1.1)
