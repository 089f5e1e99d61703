"""The report's plots, as SVG: drawn small, so that a phone need not shrink their letters."""

import contextlib
import io
import typing
from collections.abc import Iterator, Sequence

import matplotlib
import numpy as np
from matplotlib import collections, figure, ticker

from fetch_composer.explorer.episodes.episode import Episode, held, padded
from fetch_composer.explorer.pictures import style
from fetch_composer.tasks import rewards

WIDTH = 5.0  # inches
_HEIGHT = 3.3
LEFT, RIGHT, ABOVE, BELOW = 0.74, 0.22, 0.14, 0.54  # inches around the axes.
_ALL = 30  # With more episodes, lines are drawn as pixels, and of actions only a band.
_DPI = 200  # Of what is drawn as pixels.
_BAND = (10, 90)  # Percentiles.
_THRESHOLD_CM = 100 * rewards.DISTANCE_THRESHOLD
_MOST_BINS = 40
_NEAREST_CM = 0.01  # On a logarithmic axis.


@contextlib.contextmanager
def svg(height: float = _HEIGHT, below: float = BELOW) -> Iterator[tuple[figure.Figure, list[str]]]:
    """Gives a figure to draw on, and a list that has its SVG once it is drawn.

    Args:
        height: Its height in inches.
        below: Inches that the axes leave free below them.
    """
    # The same drawing is the same text: neither a date nor random identifiers.
    settings: dict[typing.Any, typing.Any] = {
        'svg.hashsalt': 'fetch_composer',
        'font.size': 11,
        'axes.edgecolor': style.FAINT,
        'axes.labelcolor': style.INK,
        'xtick.color': style.FAINT,
        'ytick.color': style.FAINT,
        'axes.spines.top': False,
        'axes.spines.right': False,
    }
    with matplotlib.rc_context(settings):
        canvas = figure.Figure(figsize=(WIDTH, height))
        # Matplotlib's layouts would take as long as all that is drawn.
        canvas.subplots_adjust(
            LEFT / WIDTH, below / height, 1 - RIGHT / WIDTH, 1 - ABOVE / height, hspace=0.12
        )
        result: list[str] = []
        yield canvas, result
        text = io.StringIO()
        canvas.savefig(text, format='svg', metadata={'Date': None}, dpi=_DPI)
        result.append(text.getvalue())


def lines(axes, paths: Sequence[np.ndarray], episodes: Sequence[Episode], **kwargs) -> None:
    """Draws a line, (n, 2), for each episode, coloured by how it ended, failures on top."""
    alpha = float(np.clip(2.5 / np.sqrt(len(episodes)), 0.1, 0.7))
    for reached in (True, False):
        chosen = [p for p, e in zip(paths, episodes, strict=True) if e.is_success is reached]
        if chosen:
            drawn = collections.LineCollection(
                chosen,
                colors=style.SUCCESS if reached else style.FAILURE,
                alpha=alpha if reached else max(alpha, 0.3),
                linewidths=1.1,
                **kwargs,
            )
            drawn.set_rasterized(len(episodes) > _ALL)
            axes.add_collection(drawn)


def distance_over_time(
    episodes: Sequence[Episode], control_timestep: float, highest_cm: float
) -> str:
    """Returns a plot of all distances to the goal, with their median and a band.

    Args:
        episodes: The episodes; one that has ended stays where it was.
        control_timestep: Seconds from one control step to the next.
        highest_cm: Upper end of the axis, for plots that are to be compared.
    """
    distances_cm = [100 * each.distance for each in episodes]
    distance_cm = held(distances_cm)
    seconds = control_timestep * np.arange(distance_cm.shape[1])
    with svg() as (canvas, result):
        axes = canvas.subplots()
        axes.axhspan(0, _THRESHOLD_CM, color=style.SUCCESS, alpha=0.1, linewidth=0)
        paths = [np.column_stack((seconds[: len(each)], each)) for each in distances_cm]
        lines(axes, paths, episodes)
        if len(episodes) > 1:
            low, high = np.percentile(distance_cm, _BAND, axis=0)
            axes.fill_between(
                seconds,
                low,
                high,
                color=style.INK,
                alpha=0.18,
                linewidth=0,
                label='10 to 90 %',
                zorder=3,
            )
            axes.plot(seconds, np.median(distance_cm, axis=0), color=style.INK, lw=2.2,
                      label='median', zorder=4)  # fmt: skip
            axes.legend(
                loc='upper right',
                fontsize=10,
                edgecolor='none',
                facecolor=style.PAPER,
                framealpha=0.85,
            )
        axes.set_xlim(0, seconds[-1])
        axes.set_ylim(0, 1.04 * highest_cm)
        axes.set_xlabel('time (s)')
        axes.set_ylabel('distance to goal (cm)')
        axes.grid(alpha=0.2)
    return result[0]


def final_distances(episodes: Sequence[Episode], highest_cm: float) -> str:
    """Returns a histogram of the distances to the goal at the last step.

    Args:
        episodes: The episodes.
        highest_cm: Upper end of the axis, for plots that are to be compared.
    """
    distance_cm = np.array([100 * each.distance[-1] for each in episodes])
    reached = np.array([each.is_success for each in episodes])
    # An edge lies at the threshold, so that no bar holds both successes and failures.
    width = _THRESHOLD_CM / 5
    while highest_cm / width > _MOST_BINS:
        width *= 2.5 if width == _THRESHOLD_CM / 5 else 2
    last = max(highest_cm, 2 * _THRESHOLD_CM) + width
    edges = np.r_[np.arange(0, _THRESHOLD_CM, width), np.arange(_THRESHOLD_CM, last, width)]
    with svg() as (canvas, result):
        axes = canvas.subplots()
        for chosen, colour in ((reached, style.SUCCESS), (~reached, style.FAILURE)):
            axes.hist(distance_cm[chosen], list(edges), color=colour, edgecolor=style.PAPER, lw=0.6)
        axes.axvline(_THRESHOLD_CM, color=style.INK, linestyle='--', linewidth=1.2)
        axes.annotate(
            f'at the goal: < {_THRESHOLD_CM:.0f} cm',
            xy=(_THRESHOLD_CM, 1), xycoords=('data', 'axes fraction'),
            xytext=(5, -3), textcoords='offset points', va='top', fontsize=10, color=style.INK,
        )  # fmt: skip
        axes.set_xlim(0, edges[-1])
        axes.yaxis.set_major_locator(ticker.MaxNLocator(integer=True))
        axes.set_xlabel('distance to goal at the last step (cm)')
        axes.set_ylabel('episodes')
    return result[0]


def actions_over_time(
    episodes: Sequence[Episode], control_timestep: float, components: Sequence[str]
) -> str:
    """Returns a plot of the components of the actions, with median and band.

    Args:
        episodes: The episodes; one that has ended no longer counts.
        control_timestep: Seconds from one control step to the next.
        components: Their names.
    """
    actions = np.clip(padded([each.action for each in episodes]), -1, 1)
    seconds = control_timestep * np.arange(actions.shape[1])
    with svg(1.4 * len(components)) as (canvas, result):
        rows = canvas.subplots(len(components), 1, sharex=True)
        for component, (axes, name) in enumerate(zip(rows, components, strict=True)):
            values = actions[:, :, component]
            axes.axhline(0, color=style.FAINT, linewidth=0.6)
            if len(episodes) <= _ALL:
                paths = [np.column_stack((seconds, each)) for each in values]
                lines(axes, paths, episodes)
            if len(episodes) > 1:
                low, high = np.nanpercentile(values, _BAND, axis=0)
                axes.fill_between(seconds, low, high, color=style.INK, alpha=0.15, linewidth=0)
                axes.plot(seconds, np.nanmedian(values, axis=0), color=style.INK, linewidth=1.8)
            axes.set_ylim(-1.08, 1.08)
            axes.set_yticks((-1, 0, 1))
            axes.set_ylabel(name)
        rows[-1].set_xlim(0, max(seconds[-1], control_timestep))
        rows[-1].set_xlabel('time (s)')
        canvas.align_ylabels()
    return result[0]


def paired_distances(pairs: Sequence[tuple[Episode, Episode]], first: str, second: str) -> str:
    """Returns a plot of final distances, a point for each seed, on logarithmic axes.

    Args:
        pairs: Episodes of two policies, of the same seed each.
        first: Label of the first policy, along x.
        second: Label of the second policy, along y.
    """
    distances = np.array([[100 * each.distance[-1] for each in pair] for pair in pairs])
    distances = np.maximum(distances, _NEAREST_CM)
    better = np.array([two.is_success and not one.is_success for one, two in pairs])
    worse = np.array([one.is_success and not two.is_success for one, two in pairs])
    limits = (
        0.8 * min(distances.min(), _THRESHOLD_CM / 2),
        1.25 * max(distances.max(), 2 * _THRESHOLD_CM),
    )
    with svg(4.4) as (canvas, result):
        axes = canvas.subplots()
        axes.plot(limits, limits, color=style.FAINT, linewidth=1)
        for draw in (axes.axvline, axes.axhline):
            draw(_THRESHOLD_CM, color=style.INK, linestyle='--', linewidth=0.9)
        for chosen, colour in (
            (~better & ~worse, style.FAINT), (better, style.SUCCESS), (worse, style.FAILURE),
        ):  # fmt: skip
            axes.scatter(
                distances[chosen, 0],
                distances[chosen, 1],
                s=16,
                color=colour,
                alpha=0.6,
                linewidths=0,
                rasterized=len(pairs) > 20 * _ALL,
            )
        axes.set(xscale='log', yscale='log', xlim=limits, ylim=limits, aspect='equal')
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f'{value:g}'))
            axis.set_minor_formatter(ticker.NullFormatter())
        # Names of the user's: dollars in them are no formulas.
        axes.set_xlabel(f'{first} (cm)', parse_math=False)
        axes.set_ylabel(f'{second} (cm)', parse_math=False)
    return result[0]
