"""The documents: their code runs, their links lead somewhere, their tables name what there is."""

import dataclasses
import os
import pathlib
import re
import subprocess
import sys

import pytest

from benchmarks import __main__ as bench
from benchmarks import markdown, report, rows
from docs import make_datasets, make_results
from fetch_composer import tasks
from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import provenance
from fetch_composer.tasks import action_modes, layout, pixels, registry, variations

_ROOT = pathlib.Path(__file__).parents[1]
_DOCS = _ROOT / 'docs'
_README = _ROOT / 'README.md'
_WITH_CODE = (_README, *sorted(_DOCS.glob('*.md')))
_PAGES = (*_WITH_CODE, _ROOT / 'CHANGELOG.md', _ROOT / 'benchmarks' / 'README.md')

# (page, what is in the code): why it is not run here.
_NOT_RUN = {
    ('accelerator.md', 'WarpBatchEnvironment'): 'needs an accelerator; tests/accelerator tests it',
    ('new_task.md', "register('push_through_gate')"): 'tests/test_new_task.py runs it',
    ('clients.md', 'from stable_baselines3'): 'needs Stable-Baselines3, and torch',
    ('clients.md', 'SB3VecEnv'): 'needs Stable-Baselines3, and torch',
    ('datasets.md', 'import minari'): 'tests/clients/test_minari.py runs it',
    ('datasets.md', 'episode = dataset[0]'): 'tests/clients/test_minari.py runs it',
}


def _name(page: pathlib.Path) -> str:
    return page.name if page.parent == _DOCS else str(page.relative_to(_ROOT))


def _code(page: pathlib.Path) -> list[str]:
    return re.findall(r'```python\n(.*?)```', page.read_text(encoding='utf-8'), re.DOTALL)


def _table(page: str, header: str) -> list[list[str]]:
    """Returns the cells of the table in docs whose first line starts with `header`."""
    return markdown.rows(_DOCS / page, header)


def _names(cell: str) -> list[str]:
    return re.findall(r'`([^`]+)`', cell)


@pytest.mark.parametrize('page', _WITH_CODE, ids=_name)
def test_the_code_of_a_page_runs_in_its_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    skipped = [text for name, text in _NOT_RUN if name == page.name]
    namespace: dict = {'__name__': 'documents'}
    for code in _code(page):
        if not any(text in code for text in skipped):
            exec(compile(code, str(page), 'exec'), namespace)


def test_what_is_not_run_is_there():
    for name, text in _NOT_RUN:
        assert any(text in code for code in _code(_DOCS / name)), (name, text)


@pytest.mark.parametrize('page', _PAGES, ids=_name)
def test_links_lead_to_files_and_headings(page):
    for target, heading in re.findall(
        r'\]\(([^)#\s]*)(?:#([^)\s]+))?\)', page.read_text(encoding='utf-8')
    ):
        if target.startswith(('http:', 'https:')):
            continue
        linked = page.parent / target if target else page
        assert linked.exists(), target
        if heading:
            assert heading in _headings(linked), f'{target}#{heading}'


def _headings(page: pathlib.Path) -> list[str]:
    """Returns the anchors of a page, as GitHub makes them of its headings."""
    titles = re.findall(r'^#+ (.*)$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return [re.sub(r'[^\w\- ]', '', title.lower()).replace(' ', '-') for title in titles]


def test_the_readme_is_short():
    assert len(_README.read_text(encoding='utf-8').splitlines()) <= 150


def test_every_page_is_reached_from_the_readme():
    text = _README.read_text(encoding='utf-8')
    pages = {page.name for page in _DOCS.glob('*.md')} - {'index.md'}  # The site's README.
    assert not [name for name in pages if f'(docs/{name}' not in text]


def test_the_table_of_options_is_that_of_the_code():
    documented = {name: row for row in _table('tasks.md', '| option |') for name in _names(row[0])}
    fields = {field.name: field.default for field in dataclasses.fields(tasks.TaskOptions)}
    assert list(documented) == list(fields)
    for name, default in fields.items():
        if default is not None:
            assert documented[name][2].strip('`') == repr(default)


def test_the_table_of_action_modes_is_that_of_the_code():
    table = _table('tasks.md', '| `action_mode` | numbers |')
    rows = {row[0].strip("`'"): row[1:] for row in table}
    assert list(rows) == list(action_modes.MODES)
    for name, (size, meaning) in rows.items():
        named = meaning.partition(':')[0].replace(' ', '_').split(',_')
        assert (int(size), tuple(named)) == (len(named), action_modes.MODES[name].components)
    scales = (action_modes.RADIANS_PER_UNIT, action_modes.JOINT_RADIANS_PER_UNIT)
    assert [f'{each} rad per unit' in rows['joints'][1] for each in scales] == [False, True]
    assert f'{scales[0]} rad per unit' in rows['displacement+rotation'][1]


def test_the_table_of_picture_options_is_that_of_the_code():
    documented = {
        name: row[2].strip('`')
        for row in _table('tasks.md', '| key of `pixels` |')
        for name in _names(row[0])
    }
    fields = dataclasses.fields(pixels.PixelOptions)
    assert documented == {field.name: repr(field.default) for field in fields}


def test_the_table_of_variations_is_that_of_the_code():
    documented = [name for row in _table('variations.md', '| name |') for name in _names(row[0])]
    assert tuple(documented) == variations.NAMES


def test_the_table_of_the_tasks_is_that_of_the_code():
    documented = [name for row in _table('tasks.md', '| task |') for name in _names(row[0])]
    assert set(tasks.published()) < set(documented) <= set(tasks.ALL)
    for name in set(tasks.ALL) - set(documented):  # Those that other tests register.
        assert not registry.task_class(name).__module__.startswith('fetch_composer')


def test_the_table_of_the_observation_is_that_of_the_code():
    def indices(cell: str) -> slice:
        first, *last = map(int, cell.split('–')) if cell else (0, -1)
        return slice(first, (last or [first])[0] + 1) if cell else slice(0)

    for column, expected in ((0, layout.WITH_OBJECT), (1, layout.WITHOUT_OBJECT)):
        documented = {row[4].strip('`'): indices(row[column]) for row in _observation_rows()}
        assert documented == {k: v for k, v in expected._asdict().items() if k != 'size'}
        assert max(each.stop for each in documented.values()) == expected.size


def _observation_rows() -> list[list[str]]:
    return _table('tasks.md', '| with an object | without |')


@pytest.mark.parametrize(
    ('page', 'name'),
    (
        (_DOCS / 'speed.md', report.SPEED_TABLE),
        (_README, report.SPEED_SUMMARY),
        (_DOCS / 'conventions.md', 'parity table: made by make parity'),
        (_DOCS / 'results.md', make_results.TABLE),
        (_DOCS / 'datasets.md', make_datasets.TABLE),
        (_DOCS / 'reliability.md', 'soak table: made by make soak'),
    ),
    ids=('speed', 'summary', 'parity', 'results', 'datasets', 'soak'),
)
def test_tables_of_figures_have_their_places(page, name):
    assert markdown.has_markers(page, name)


def test_a_table_replaces_what_stood_between_its_markers(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text('A\n<!-- one -->\nold\n<!-- end -->\nB\n<!-- two -->\nkept\n<!-- end -->\nC\n')
    table = markdown.table(('', 'x'), [('a', '1'), ('b', '2')])
    for _ in range(2):
        markdown.write_between_markers(page, 'one', table)
    assert page.read_text() == (
        'A\n<!-- one -->\n|  | x |\n| --- | --- |\n| a | 1 |\n| b | 2 |\n<!-- end -->\nB\n'
        '<!-- two -->\nkept\n<!-- end -->\nC\n'
    )


def test_a_table_is_read_by_the_start_of_its_first_line(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text('A\n| a | b |\n|---|---|\n| 1 | |\n| 2 | x y |\n<!-- end -->\n| no |\n')
    assert markdown.rows(page, '| a |') == [['1', ''], ['2', 'x y']]
    with pytest.raises(ValueError, match=r"page.md must have one table that starts with '\| c"):
        markdown.rows(page, '| c |')


@pytest.mark.parametrize(
    'text', ('', '<!-- one -->\n', '<!-- end -->\n<!-- one -->\n', '<!-- one --><!-- end -->\n' * 2)
)
def test_a_page_without_markers_is_left_alone_and_they_are_named(tmp_path, text):
    page = tmp_path / 'page.md'
    page.write_text(text)
    with pytest.raises(ValueError, match='page.md must have .*<!-- one --> and <!-- end -->'):
        markdown.write_between_markers(page, 'one', 'table')
    assert page.read_text() == text


def test_the_table_of_results_is_made_once_and_says_what_does_not_ship(tmp_path, monkeypatch):
    commands = []

    def run(command, check):
        assert check
        commands.append(command)
        (folder,) = (each.split('=')[1] for each in command if each.startswith('--output_dir'))
        asked = [each.split('=')[1] for each in command if each.startswith('--policy')]
        rows = [['slide', 'some', policy, '50.0 (46.9–53.1)', '-30.0', '9.87'] for policy in asked]
        origin = {'versions': provenance.versions(), 'code': provenance.code_digest()}
        files.prepare_folder(pathlib.Path(folder))
        files.save_json(pathlib.Path(folder, 'summary.json'), {**origin, 'standard': rows})

    monkeypatch.setattr(make_results.subprocess, 'run', run)
    monkeypatch.setattr(make_results, '_TRAINED', tmp_path / 'nothing ships')
    page = tmp_path / 'results.md'
    page.write_text((_DOCS / 'results.md').read_text(encoding='utf-8'), encoding='utf-8')
    words = ['--runs', str(tmp_path), '--page', str(page), '--tasks', 'slide']
    for _ in range(2):
        make_results.main(make_results.parser.parse_args(words))
    assert len(commands) == 2  # Of the two conventions.
    assert all('--standard' in each and '--policy=trained' not in each for each in commands)
    text = page.read_text(encoding='utf-8')
    for convention in ('documented', 'gymnasium_robotics'):
        assert f'| slide | {convention} | trained | none ships |  |  |' in text
    assert text.count('| slide | some | expert | 50.0 (46.9–53.1) | -30.0 | 9.87 |') == 2
    assert f'mujoco {provenance.versions()["mujoco"]}' in text


def _measured(**changes) -> dict:
    figures = {'ratio': 2.0, 'ratio_quartiles': [1.9, 2.1], 'our_cost': 1e-3, 'peer_cost': 2e-3}
    measured = [
        {
            'group': row.group,
            'ours': row.ours.label,
            'peer': row.peer.label,
            'quantity': row.quantity,
            'unit': row.unit,
            **figures,
            **changes,
        }
        for row in rows.all_rows()
    ]
    packages = {'mujoco': '3.17.0'}
    machine = {'system': 'Linux', 'architecture': 'x86_64', 'processors': 2, 'python': '3.11.7'}
    return {'machine': {**machine, 'packages': packages}, 'rows': measured}


def test_the_tables_of_speed_have_the_rows_that_were_measured():
    results = _measured()
    assert report.is_complete(results)
    tables = report.markdown_tables(results)
    assert tables[report.SPEED_TABLE].count('\n| ') == len(results['rows']) + 1
    assert '**2.00** (1.90–2.10) | 1,000 steps/s | 500 steps/s' in tables[report.SPEED_TABLE]
    assert 'on 2 processors (Linux, x86_64)' in tables[report.SPEED_TABLE]
    assert tables[report.SPEED_SUMMARY].count('\n| ') == len(report.HEADLINES) + 1


def test_the_tables_of_speed_are_written_into_pages(tmp_path):
    results = _measured()
    for page, name in ((_DOCS / 'speed.md', report.SPEED_TABLE), (_README, report.SPEED_SUMMARY)):
        copy = tmp_path / page.name
        copy.write_text(page.read_text(encoding='utf-8'), encoding='utf-8')
        report.write_page(results, copy)
        assert report.markdown_tables(results)[name] in copy.read_text(encoding='utf-8')


def test_a_page_without_a_place_for_a_table_is_named_before_anything_is_measured(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text('Nothing.')
    with pytest.raises(ValueError, match='page.md must have the line <!-- speed table: made by'):
        bench.main(['--write', str(page)])


def test_a_table_with_rows_missing_is_incomplete():
    assert not report.is_complete(_measured(skipped='envpool is not installed'))
    assert not report.is_complete({**_measured(), 'rows': _measured()['rows'][:3]})


def test_the_table_of_flags_is_that_of_the_explorer():
    command = [sys.executable, '-m', 'fetch_composer.explorer', '--help']
    environment = {**os.environ, 'MUJOCO_GL': 'disabled', 'PYTHONPATH': str(_ROOT)}
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    flags = set(re.findall(r'^  --(?:\[no\])?(\w+):', run.stdout, re.MULTILINE)) - {'help'}
    documented = [name for row in _table('explorer.md', '| flag |') for name in _names(row[0])]
    assert sorted(documented) == sorted(f'--{name}' for name in flags)
