"""How a run went: distance to the goal and return over time."""

import pathlib
from collections.abc import Sequence

import numpy as np
from matplotlib import figure

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes.episode import Episode, held
from fetch_composer.explorer.pictures import style
from fetch_composer.tasks import rewards

_SIZE = (9, 7)  # inches
_DPI = 130
_CLEAR = {'facecolor': style.PAPER, 'edgecolor': 'none', 'alpha': 0.8}  # Text over lines.


def save_progress(
    path: pathlib.Path,
    episodes: Sequence[Episode],
    title: str,
    control_timestep: float,
) -> None:
    """Writes a png with a line for each episode and their median.

    Args:
        path: The file.
        episodes: The episodes; one that has ended stays as it was.
        title: Title of the plot.
        control_timestep: Seconds from one control step to the next.
    """
    distance_cm = [100 * each.distance for each in episodes]
    returns = [np.cumsum([0, *each.reward]) for each in episodes]
    seconds = control_timestep * np.arange(max(map(len, returns)))

    canvas = figure.Figure(figsize=_SIZE, dpi=_DPI)
    canvas.subplots_adjust(left=0.09, right=0.98, bottom=0.08, top=0.93, hspace=0.08)
    # It has a name of the user's in it: dollars in that are no formulas.
    canvas.suptitle(title, fontsize=13, fontweight='bold', color=style.INK, parse_math=False)
    distance_axes, return_axes = canvas.subplots(2, 1, sharex=True)

    threshold_cm = 100 * rewards.DISTANCE_THRESHOLD
    distance_axes.axhspan(0, threshold_cm, color=style.SUCCESS, alpha=0.1, linewidth=0)
    distance_axes.annotate(
        f'at the goal: within {threshold_cm:.0f} cm',
        xy=(1, threshold_cm), xycoords=('axes fraction', 'data'),
        xytext=(-6, 4), textcoords='offset points',
        ha='right', va='bottom', fontsize=10, color=style.SUCCESS, bbox={**_CLEAR, 'pad': 1},
        zorder=5,
    )  # fmt: skip
    _draw(distance_axes, seconds, distance_cm, episodes)
    distance_axes.set_ylabel('distance to goal (cm)', fontsize=11)
    distance_axes.set_ylim(bottom=0)
    legend = distance_axes.legend(
        fontsize=10, loc='upper right', edgecolor='none', facecolor=style.PAPER, framealpha=0.8
    )
    for handle in legend.legend_handles:
        handle.set(alpha=1, linewidth=2.4)

    _draw(return_axes, seconds, returns, episodes)
    return_axes.set_ylabel('return so far', fontsize=11)
    return_axes.set_xlabel('time (s)', fontsize=11)
    return_axes.set_xlim(0, seconds[-1])
    with files.whole_file(path) as partial:
        canvas.savefig(partial, facecolor=style.PAPER)


def _draw(axes, seconds, values, episodes: Sequence[Episode]) -> None:
    """Draws a line for each episode, coloured by how it ended, and the median of all."""
    alpha = float(np.clip(2.5 / np.sqrt(len(episodes)), 0.12, 0.7))
    labelled = set()
    # Failures last, so that they lie on top.
    for episode, line in sorted(
        zip(episodes, values, strict=True), key=lambda pair: not pair[0].is_success
    ):
        reached = episode.is_success
        label = 'ends at the goal' if reached else 'ends elsewhere'
        axes.plot(
            seconds[: len(line)],
            line,
            color=style.SUCCESS if reached else style.FAILURE,
            alpha=alpha,
            linewidth=1.2,
            label=None if label in labelled else label,
        )
        labelled.add(label)
    if len(episodes) > 1:
        axes.plot(
            seconds, np.median(held(values), axis=0), color=style.INK, linewidth=2.4, label='median'
        )
    axes.grid(alpha=0.25)
    axes.spines[['top', 'right']].set_visible(False)
    axes.tick_params(labelsize=10)
