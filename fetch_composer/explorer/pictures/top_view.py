"""The table seen from above, with the paths of gripper and objects."""

from collections.abc import Sequence

import numpy as np
from matplotlib import lines as line_marks
from matplotlib import patches

from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import charts, style
from fetch_composer.tasks import layout, rewards, scene

_MARGIN = 0.05  # m around what is shown: the table, or an episode's paths ...
_NARROWEST = 0.4  # ... but at least this much is shown.
_GRIPPER = '#8a94a0'
_GOAL = '#00795c'
_TABLE = '#f1efe9'
_COLUMNS, _ROW = 3, 0.2  # Of the legend; a row in inches.
_GRIPPERS_OF = 12  # With more episodes than these, only the objects' paths are drawn.


def top_view(episodes: Sequence[Episode], workspace: scene.Workspace, has_object: bool) -> str:
    """Returns an SVG of the paths in the plane of the table; x points away from the robot.

    Args:
        episodes: One or more episodes.
        workspace: Where the table is.
        has_object: Whether the achieved goal is the place of objects, or of the gripper.
    """
    grippers = [each.observation[:, layout.WITH_OBJECT.grip_position][:, :2] for each in episodes]
    things = [path for each in episodes for path in _paths(each.achieved_goal)]
    goals = np.stack([path[-1] for each in episodes for path in _paths(each.desired_goal)])
    # Of each path, the episode.
    owners = [each for each in episodes for _ in range(len(things) // len(episodes))]
    centre, half = np.array(workspace.table_position[:2]), np.array(workspace.table_half_size[:2])
    one = len(episodes) == 1
    corners = np.concatenate([goals, *things])
    if len(episodes) <= _GRIPPERS_OF:
        corners = np.concatenate([corners, *grippers])
    if not one:
        corners = np.concatenate([corners, [centre - half, centre + half]])
    low, high = corners.min(axis=0) - _MARGIN, corners.max(axis=0) + _MARGIN
    lacking = np.maximum(_NARROWEST - (high - low), 0) / 2
    low, high = low - lacking, high + lacking
    few = len(episodes) <= _GRIPPERS_OF
    handles = _legend(episodes, has_object, few)
    below = charts.BELOW + _ROW * -(-len(handles) // _COLUMNS)
    width = charts.WIDTH - charts.LEFT - charts.RIGHT
    height = float(np.clip(width * (high - low)[1] / (high - low)[0], 2.8, 4.4))

    with charts.svg(charts.ABOVE + height + below, below) as (canvas, result):
        axes = canvas.subplots()
        axes.add_patch(
            patches.Rectangle(centre - half, *(2 * half), facecolor=_TABLE, edgecolor='#d8d4c8')
        )
        if has_object and few:
            for path in grippers:
                axes.plot(*path.T, color=_GRIPPER, linewidth=1.1, alpha=1 if one else 0.5)
                axes.plot(*path[0], 'o', mfc=style.PAPER, mec=_GRIPPER, ms=5)
        charts.lines(axes, things, owners, zorder=3)
        _mark(axes, things, goals, owners, few)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect='equal')
        axes.set_xlabel('x (m), away from the robot')
        axes.set_ylabel('y (m)')
        axes.grid(alpha=0.15)
        canvas.legend(
            handles=handles, loc='lower center', ncols=_COLUMNS, frameon=False, fontsize=9.5,
            handletextpad=0.4, columnspacing=1.0, borderaxespad=0,
        )  # fmt: skip
    return result[0]


def _paths(places: np.ndarray) -> list[np.ndarray]:
    """Returns the path of each object, (T + 1, 2) in m, from goals of (T + 1, 3 n)."""
    return list(places.reshape(len(places), -1, 3)[..., :2].swapaxes(0, 1))


def _mark(axes, things, goals: np.ndarray, owners: Sequence[Episode], few: bool) -> None:
    """Marks starts, ends and goals; with many episodes the starts are left out."""
    reached = np.array([each.is_success for each in owners])
    starts, ends = (np.stack([path[i] for path in things]) for i in (0, -1))
    if few:
        for goal in goals:
            axes.add_patch(
                patches.Circle(
                    goal, rewards.DISTANCE_THRESHOLD, fill=False, edgecolor=_GOAL, linestyle='--'
                )
            )
        axes.plot(*goals.T, '+', color=_GOAL, ms=9, mew=1.6, zorder=6)
        size, alpha = 8.0, 1.0
    else:
        size = float(np.clip(60 / np.sqrt(len(owners)), 1.6, 4))
        alpha = float(np.clip(12 / np.sqrt(len(owners)), 0.35, 1))
        axes.plot(*goals.T, '+', color=_GOAL, ms=4, mew=0.7, alpha=0.7 * alpha, rasterized=True)
    for chosen, colour, opacity in ((reached, style.SUCCESS, alpha), (~reached, style.FAILURE, 1)):
        if few:
            axes.plot(*starts[chosen].T, 's', mfc=style.PAPER, mec=colour, ms=size, zorder=4)
        axes.plot(
            *ends[chosen].T, 's', color=colour, ms=size, mew=0, alpha=opacity, zorder=5,
            rasterized=not few,
        )  # fmt: skip


def _legend(episodes, has_object: bool, few: bool) -> list[line_marks.Line2D]:
    def mark(label: str, **kwargs) -> line_marks.Line2D:
        return line_marks.Line2D([], [], label=label, **kwargs)

    ends = {each.is_success for each in episodes}
    colour = style.SUCCESS if True in ends else style.FAILURE
    thing = 'object' if has_object else 'gripper'
    handles = [mark('goal', color=_GOAL, marker='+', linestyle='', ms=9, mew=1.6)]
    if few:
        hollow = {'mfc': style.PAPER, 'mec': colour, 'ms': 7}
        handles.append(mark(f'{thing}, start', color=colour, marker='s', linestyle='', **hollow))
    if True in ends:
        label = f'{thing}, at the goal'
        handles.append(mark(label, color=style.SUCCESS, marker='s', ms=6))
    if False in ends:
        label = f'{thing}, elsewhere'
        handles.append(mark(label, color=style.FAILURE, marker='s', ms=6))
    if has_object and few:
        handles.append(mark('gripper', color=_GRIPPER, marker='o', mfc=style.PAPER, ms=5))
    return handles
