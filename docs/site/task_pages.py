"""A page for each task, as Gymnasium has them: what can be generated from the code, is.

Sentences and figures that a table in docs has already are taken from there.
"""

import pathlib
import re
from collections.abc import Iterator

import jinja2

import fetch_composer
from benchmarks import markdown
from docs.site import linked_files
from fetch_composer import gymnasium_ids, tasks
from fetch_composer.interfaces import gymnasium_common
from fetch_composer.tasks import action_modes, goal_task, layout, rewards

_DOCS = pathlib.Path(__file__).parents[1]
_TEMPLATE = pathlib.Path(__file__).parent / 'task.md.j2'

_AXES = ('x', 'y', 'z')
_SIDES = ('right', 'left')
_FINGERS = 'the right and the left finger'
_ORDINALS = ('first', 'second')
# What each convention's version of an id stands for; the names are those of `tasks.conventions`.
_VERSIONS = {
    'gymnasium_robotics': 'what Gymnasium-Robotics 1.4.2 does in its version of that number',
    'documented': "what Gymnasium-Robotics' page of that version says",
}


def write(folder: pathlib.Path) -> None:
    """Writes a page for each task."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in fetch_composer.ALL:
        (folder / f'{name}.md').write_text(page(name), encoding='utf-8')


def page(name: str) -> str:
    """Returns the page of a task, in Markdown."""
    made = {each: tasks.make(name, convention=each) for each in tasks.conventions_of(name)}
    task = made['documented']
    _, thing, start, goal, _ = _described(name)
    action_space, observation_space = _spaces(name)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATE.parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(_TEMPLATE.name).render(
        name=name,
        title=name.title().replace('_And_', '-and-').replace('_', ' '),
        summary=type(task).__doc__.splitlines()[0],
        thing=thing,
        start=start,
        goal=goal,
        num_objects=len(task.scene.objects),
        is_published=name in tasks.published(),
        locked=task.locked_gripper,
        ids={each: gymnasium_ids.env_id(name, each) for each in made},
        dense_id=gymnasium_ids.env_id(name, 'documented', 'dense'),
        versions=_VERSIONS,
        version_of=lambda id: id.rsplit('-', 1)[1],
        action_space=action_space,
        observation_space=observation_space,
        hertz=round(1 / task.control_timestep),
        control_timestep=task.control_timestep,
        physics_timestep=goal_task.PHYSICS_TIMESTEP,
        substeps=round(task.control_timestep / goal_task.PHYSICS_TIMESTEP),
        threshold=rewards.DISTANCE_THRESHOLD,
        steps=task.options.max_episode_steps,
        actions=markdown.table(('Num', 'Action', 'Min', 'Max', 'Unit'), action_rows(name)),
        observations=markdown.table(
            ('Num', 'Observation', 'Min', 'Max', 'Unit', 'Slice'), observation_rows(name)
        ),
        starts=markdown.table(('', *(f'`{each}`' for each in made)), _start_rows(made)),
        arguments=markdown.table(('Argument', 'Values', 'Default'), _arguments(task)),
        results=markdown.table(
            ('Convention', 'Policy', 'Success (%)', 'Return', 'Distance (cm)'), _results(name)
        ),
    )


def action_rows(name: str) -> Iterator[tuple[str, ...]]:
    """Yields number, meaning, minimum, maximum and unit of each number of a task's action."""
    spec = action_modes.DISPLACEMENT.spec
    locked = tasks.make(name).locked_gripper
    fingers = (
        'none: the gripper is locked' if locked else 'opening (+) and closing (−) of the fingers'
    )
    meanings = [f'displacement of the gripper, {axis}' for axis in _AXES] + [fingers]
    units = [f'{action_modes.METRES_PER_UNIT}\N{NO-BREAK SPACE}m'] * len(_AXES) + [
        '–' if locked else 'm'
    ]
    bounds = f'{float(spec.minimum)}', f'{float(spec.maximum)}'
    for number, (meaning, unit) in enumerate(zip(meanings, units, strict=True)):
        yield str(number), meaning, *bounds, unit


def observation_rows(name: str) -> list[tuple[str, ...]]:
    """Returns the same of each number of the vector `observation`, and its slice in `layout`."""
    layouts = layout.of(len(tasks.make(name).scene.objects))
    _, observation_space = _spaces(name)
    space = observation_space['observation']
    rows = {}
    for places, ordinal in zip(layouts, _ORDINALS, strict=False):
        for slice_name, indices in _indices(places).items():
            *_, meaning, unit, _ = _row('| with an object | without |', slice_name, column=-1)
            if len(layouts) > 1:
                meaning = re.sub(r'\bobject', f'{ordinal} object', meaning)
            if _FINGERS in meaning:
                meanings = [meaning.replace(_FINGERS, f'the {side} finger') for side in _SIDES]
            else:
                meanings = [f'{meaning}: {axis}' for axis in _AXES]
            for index, each in zip(indices, meanings, strict=True):
                bounds = f'{space.low[index]:g}', f'{space.high[index]:g}'
                rows[index] = (str(index), each, *bounds, unit, f'`{slice_name}`')
    return [rows[index] for index in sorted(rows)]


def _indices(places: layout.Layout) -> dict[str, range]:
    """Returns the indices of each slice of a layout that is not empty."""
    slices = {name: each for name, each in places._asdict().items() if name != 'size'}
    found = {name: range(*each.indices(places.size)) for name, each in slices.items()}
    return {name: indices for name, indices in found.items() if indices}


def _spaces(name: str):
    env = fetch_composer.load(name)
    return gymnasium_common.spaces_of(env.action_spec(), env.observation_spec())


def _start_rows(made: dict[str, goal_task.GoalTask]) -> Iterator[list[str]]:
    def row(meaning: str, values) -> list[str]:
        return [meaning, *(_numbers(each) for each in values)]

    each = list(made.values())
    yield row("base of the robot's frame, m", (task.workspace.robot_position for task in each))
    yield row('observed gripper, m', (task.grip_start for task in each))
    yield row('surface of the table, z in m', (task.workspace.table_top for task in each))
    if each[0].scene.objects:
        yield row("object's centre, z in m", (task.object_height for task in each))
        yield row('its quaternion (w, x, y, z)', (task.options.object_quaternion for task in each))


def _numbers(values) -> str:
    try:
        return f'({", ".join(f"{value:.4g}" for value in values)})'
    except TypeError:
        return f'{values:.4g}'


def _arguments(task: goal_task.GoalTask) -> Iterator[list[str]]:
    of_objects = () if task.scene.objects else ('`object_position`',)
    page = _DOCS / 'tasks.md'
    for row in markdown.rows(page, '| option |'):
        if row[0] not in of_objects:
            there = [re.sub(r'\[(above|below)\]', '[Tasks]', each) for each in row]
            yield [linked_files.rewritten(each, page) for each in there]


def _results(name: str) -> Iterator[list[str]]:
    for task, *row in markdown.rows(_DOCS / 'results.md', '| task | convention | policy |'):
        if task == name:
            yield row


def _described(name: str) -> list[str]:
    """Returns a task's row of the table of tasks, with what it shares with another written out."""
    row = _row('| task |', name)
    for column, cell in enumerate(row):
        shared = re.match(r'as in `(\w+)`', cell)
        if shared:
            row[column] = cell.replace(shared[0], _row('| task |', shared[1])[column], 1)
    return row


def _row(header: str, name: str, column: int = 0) -> list[str]:
    """Returns the row of a table in docs/tasks.md that has a name in a column."""
    for row in markdown.rows(_DOCS / 'tasks.md', header):
        if row[column] == f'`{name}`':
            return row
    raise ValueError(f'The table {header!r} in docs/tasks.md has no row `{name}`.')
