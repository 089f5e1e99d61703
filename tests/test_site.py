"""The site: every page is in its tree, its pages of tasks say what the tasks do, links lead on."""

import fnmatch
import pathlib
import re
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import fetch_composer
from docs.site import linked_files, task_pages
from fetch_composer import tasks
from fetch_composer.tasks import layout
from tests import api_pages, episodes

_DOCS = pathlib.Path(task_pages.__file__).parents[1]


@pytest.fixture(scope='module', params=fetch_composer.ALL)
def task(request) -> str:
    return request.param


@pytest.fixture(scope='module')
def page(task) -> str:
    return task_pages.page(task)


def _in_tree() -> list[str]:
    """Returns the lines of the front page's trees, each a page or a pattern of pages."""
    trees = re.findall(r'```{toctree}\n(.*?)```', (_DOCS / 'index.md').read_text(), re.DOTALL)
    lines = '\n'.join(trees).splitlines()
    return [line for line in lines if line and not line.startswith(':')]


def test_every_page_is_in_the_tree():
    assert set(tasks.published()) == {'pick_and_place', 'push', 'reach', 'slide'}
    pages = [str(each.relative_to(_DOCS).with_suffix('')) for each in _DOCS.rglob('*.md')]
    for name in pages:
        if name != 'index' and not name.startswith('generated/files'):
            folder = str(pathlib.PurePath(name).parent)
            # As Sphinx has it, a star stays within its folder.
            here = [each for each in _in_tree() if str(pathlib.PurePath(each).parent) == folder]
            assert any(fnmatch.fnmatch(name, each) for each in here), name


def test_what_is_in_the_tree_is_there():
    for name in _in_tree():
        if '*' not in name and not name.startswith('generated/'):
            assert (_DOCS / f'{name}.md').exists(), name


def test_the_observation_of_a_page_is_that_of_its_task(task):
    rows = task_pages.observation_rows(task)
    spec = episodes.shared(task).observation_spec()['observation']
    assert [int(row[0]) for row in rows] == list(range(*spec.shape))
    layouts = layout.of(len(tasks.make(task).scene.objects))
    for places in layouts:
        spoken = ' '.join(row[1] for row in rows[places.grip_position])
        assert spoken == "gripper's position: x gripper's position: y gripper's position: z"
        assert all(row[4] == 'rad' for row in rows[places.object_rotation])
        right, left = (row[1] for row in rows[places.fingers])
        assert right == left.replace('left', 'right') == 'displacement of the right finger'
        for name, place in places._asdict().items():
            if name != 'size':
                assert all(row[5] == f'`{name}`' for row in rows[place])
    if len(layouts) > 1:
        whose = [rows[places.object_position.start][1] for places in layouts]
        assert whose == ["first object's position: x", "second object's position: x"]


def test_the_action_of_a_page_is_that_of_its_task(task):
    rows = list(task_pages.action_rows(task))
    spec = episodes.shared(task).action_spec()
    assert len(rows) == spec.shape[0]
    assert {(float(row[2]), float(row[3])) for row in rows} == {(-1.0, 1.0)}
    assert ('locked' in rows[3][1]) == (task not in ('pick_and_place', 'stack'))


def test_a_page_has_the_start_of_each_convention(task, page):
    (line,) = (line for line in page.splitlines() if line.startswith('| observed gripper'))
    written = [
        [float(number) for number in cell.split(', ')] for cell in re.findall(r'\(([^)]*)\)', line)
    ]
    for convention, position in zip(tasks.conventions_of(task), written, strict=True):
        time_step = episodes.shared(task, convention=convention).reset()
        gripper = time_step.observation['observation'][layout.WITH_OBJECT.grip_position]
        np.testing.assert_allclose(position, gripper, atol=1e-3)


def test_the_ids_of_a_page_are_known_to_gymnasium(task, page):
    ids = set(re.findall(r'fetch_composer/Fetch\w+-v\d', page))
    # Each convention, and the dense reward of one.
    assert len(ids) == (3 if task in tasks.published() else 2)
    for each in ids:
        gymnasium.spec(each)


def test_the_code_of_a_page_runs(page):
    namespace: dict = {}
    for code in re.findall(r'```python\n(.*?)```', page, re.DOTALL):
        exec(compile(code, 'page', 'exec'), namespace)


def test_the_links_of_a_page_lead_to_pages_and_pictures(page):
    targets = re.findall(r'\]\(/([^)#]+)', page)
    assert targets
    for target in targets:
        assert (_DOCS / target).exists(), target


def test_only_reach_takes_no_object_position(task, page):
    assert ('`object_position`' in page) == (task != 'reach')


def test_links_to_files_lead_to_pages_of_the_site():
    page = _DOCS / 'states.md'
    text = '[a](../examples/planning.py) [b](tasks.md#options) [c](curves) [d](https://x.y) [e](#f)'
    assert linked_files.rewritten(text, page) == (
        '[a](/generated/files/examples/planning.py.md) [b](/tasks.md#options) '
        '[c](/generated/files/docs/curves.md) [d](https://x.y) [e](/states.md#f)'
    )


def test_what_is_linked_to_in_turn_has_a_page_as_well():
    found = linked_files.linked([_DOCS / 'learning.md', _DOCS.parent / 'README.md'])
    names = {str(each.relative_to(_DOCS.parent)) for each in found}
    assert {'docs/curves', 'docs/curves/tried', 'CHANGELOG.md', 'examples/planning.py'} <= names
    assert any(name.startswith('docs/curves/tried/') for name in names)
    assert not any(name.endswith(('.png', 'tasks.md')) for name in names)


def test_what_the_pages_of_the_api_name_is_there():
    assert len(api_pages.names()) > 40
    # In a process of its own, since stand-ins for packages stay.
    command = [sys.executable, '-m', api_pages.__name__]
    result = subprocess.run(command, cwd=_DOCS.parent, capture_output=True, text=True, check=True)
    assert result.stdout == ''
