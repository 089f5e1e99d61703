"""The standard evaluation: what is fixed in it, and its table."""

from collections.abc import Mapping, Sequence
from typing import Any

from fetch_composer import tasks
from fetch_composer.explorer.episodes import seeds
from fetch_composer.explorer.results.evaluation import Evaluation

# The options of a run that it fixes whatever the task, and their values.
FIXED: Mapping[str, Any] = {
    'seed': seeds.STANDARD.start,
    'episodes': len(seeds.STANDARD),
    'reward_type': 'sparse',
    'object_position': None,
    'goal': None,
    'terminate_on_success': False,
    'action_mode': 'displacement',
    'object_shape': None,
    'from_state': None,
}
HEADER = ('task', 'convention', 'policy', 'success (%)', 'return', 'distance (cm)')

_COLUMNS = 80


def fixed(task: str) -> dict[str, Any]:
    """Returns the options of a run that it fixes for a task, and their values.

    Episodes have as many control steps as those of the task have by default.
    """
    steps = tasks.default_options(task).max_episode_steps if task in tasks.ALL else None
    return {**FIXED, 'max_episode_steps': steps or tasks.MAX_EPISODE_STEPS}


def check(values: Mapping[str, Any]) -> None:
    """Raises `ValueError` if one of its options has another value than it fixes."""
    rules = fixed(values['task'])
    for name, value in rules.items():
        if values[name] != value:
            raise ValueError(
                f'standard is of seeds {seeds.STANDARD[0]} to {seeds.STANDARD[-1]}, '
                f'{rules["max_episode_steps"]} control steps, {FIXED["reward_type"]} reward, drawn '
                f"places, action_mode {FIXED['action_mode']}, and the task's own objects; got "
                f'{name} {values[name]}. Leave out {name}, or standard.'
            )


def cells(evaluation: Evaluation) -> tuple[str, ...]:
    """Returns a row of the table."""
    rate = evaluation.success_rate
    return (
        evaluation.task,
        evaluation.convention,
        ' '.join(evaluation.policy.split()).replace('|', r'\|'),
        f'{100 * rate.value:.1f} ({100 * rate.low:.1f}–{100 * rate.high:.1f})',
        f'{evaluation.mean_return.value:.1f}',
        f'{100 * evaluation.final_distance.value:.2f}',
    )


def table(evaluations: Sequence[Evaluation]) -> list[str]:
    """Returns the lines of a table in Markdown: a header, its rule, and a row for each."""
    rows = [HEADER, ('-',) * len(HEADER), *(cells(each) for each in evaluations)]
    return [_line(row) for row in rows]


def _line(row: Sequence[str]) -> str:
    line = f'| {" | ".join(row)} |'
    return line if len(line) <= _COLUMNS else f'|{"|".join(row)}|'
