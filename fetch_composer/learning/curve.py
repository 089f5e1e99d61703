"""The learning curve: its table, its file and its picture."""

import csv
import dataclasses
import io
import pathlib
from collections.abc import Sequence

from matplotlib import figure

from fetch_composer.explorer import files
from fetch_composer.explorer.pictures import style

_SIZE = (9, 4)  # inches
_DPI = 120


@dataclasses.dataclass(frozen=True)
class Point:
    """A point of the curve.

    Attributes:
        environment_steps: Control steps so far, those of Reach for the relay included.
        updates: Updates of the critics so far, those of Reach included.
        minutes: Since the run began, all included; what passed between runs is not.
        cpu_minutes: The same, of processor time.
        success: Share of episodes of the tuning seeds that end at their goal, without noise.
        exploring_success: The same of the last exploring episodes, with noise.
        loss: Mean loss of the critics.
    """

    environment_steps: int
    updates: int
    minutes: float
    cpu_minutes: float
    success: float
    exploring_success: float
    loss: float


COLUMNS = tuple(field.name for field in dataclasses.fields(Point))


def save(path: pathlib.Path, points: Sequence[Point]) -> None:
    """Writes a CSV file with a row for each point."""
    file = io.StringIO()
    rows = csv.writer(file, lineterminator='\n')
    rows.writerow(COLUMNS)
    for point in points:
        rows.writerow(f'{value:.7g}' for value in dataclasses.astuple(point))
    files.save_text(path, file.getvalue())


def load(path: pathlib.Path) -> list[Point]:
    """Returns the points of a CSV file."""
    with path.open(encoding='utf-8', newline='') as file:
        return [
            Point(
                int(float(row['environment_steps'])),
                int(float(row['updates'])),
                *(float(row[name]) for name in COLUMNS[2:]),
            )
            for row in csv.DictReader(file)
        ]


def save_picture(path: pathlib.Path, points: Sequence[Point], title: str) -> None:
    """Draws success against control steps and against minutes, as a png file."""
    canvas = figure.Figure(figsize=_SIZE, dpi=_DPI, layout='constrained')
    canvas.suptitle(title, fontsize=12, fontweight='bold', color=style.INK)
    axes_of_steps, axes_of_minutes = canvas.subplots(1, 2, sharey=True)
    for axes, label, places in (
        (axes_of_steps, 'environment steps', [point.environment_steps for point in points]),
        (axes_of_minutes, 'minutes', [point.minutes for point in points]),
    ):
        exploring = [point.exploring_success for point in points]
        axes.plot(places, exploring, color=style.FAINT, linewidth=1.2, label='while exploring')
        success = [point.success for point in points]
        axes.plot(places, success, color=style.SUCCESS, marker='.', label='without noise')
        decorate(axes, label)
    axes_of_steps.set_ylabel('success')
    axes_of_minutes.legend(loc='lower right', edgecolor='none')
    with files.whole_file(path) as partial:
        canvas.savefig(partial, facecolor=style.PAPER)


def decorate(axes, label: str) -> None:
    """Gives axes of success their look; `label` says what it is drawn against."""
    axes.set_xlabel(label)
    axes.set_ylim(0, 1.02)
    axes.set_xlim(left=0)
    axes.grid(alpha=0.25)
    axes.spines[['top', 'right']].set_visible(False)
