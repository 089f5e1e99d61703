"""The files of a run, in its folder."""

import contextlib
import dataclasses
import pathlib
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fetch_composer.explorer import files
from fetch_composer.explorer.episodes import episode as episode_lib
from fetch_composer.explorer.pictures import contact_sheet, plots
from fetch_composer.explorer.results import titles
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting

TRAJECTORIES = 'trajectories.npz'
SUMMARY = 'summary.json'
REPORT = 'report.html'
REPLAY = 'replay.html'
PROGRESS = 'progress.png'
CONTACT_SHEET = 'contact_sheet.png'
_OF_PAGES = {
    REPORT: 'one page with everything, films included',
    REPLAY: 'chosen episodes to walk around in',
}
_OWN_NAME = re.compile(
    r'replay\.html|(\d+_[\w.-]+/)?(trajectories\.npz|progress\.png|contact_sheet\.png|episode_\d{3,}\.mp4)'
)


@dataclasses.dataclass(frozen=True)
class Written:
    """Files of one kind that a run has written into its folder.

    Attributes:
        names: Their names.
        content: What is in them.
    """

    names: Sequence[str]
    content: str


def write(
    folder: pathlib.Path,
    candidates: Sequence[Candidate],
    setting: Setting,
    pages: Mapping[str, str | None],
    summary: Mapping[str, Any],
) -> list[Written]:
    """Writes what a run has found, and removes what an earlier one in its folder has left.

    Args:
        folder: The folder, which is there.
        candidates: The policies, with one finished episode or more each.
        setting: What is to be said of the task.
        pages: The report and the page that replays, by name; None for one that there is not.
        summary: The figures; the names of all files are added to them.

    Returns:
        The files, those to open first at the front.

    Raises:
        OSError: if something cannot be written.
    """
    names_before = files.load_json(folder / SUMMARY).get('files', ())
    for each in candidates:
        (folder / each.path('')).mkdir(exist_ok=True)
    there = {name: page for name, page in pages.items() if page is not None}
    for name, page in there.items():
        files.save_text(folder / name, page)
    written = [
        *(Written((name,), _OF_PAGES[name]) for name in there),
        *_write_pictures(folder, [each for each in candidates if each.films], setting),
        *_write_data(folder, candidates, setting),
        Written((SUMMARY,), 'figures, versions and flags'),
    ]
    names = [name for each in written for name in each.names]
    files.save_json(folder / SUMMARY, {**summary, 'files': names})

    # A film of an earlier and longer run would be taken for one of this run.
    for name in set(names_before) - set(names):
        if isinstance(name, str) and _OWN_NAME.fullmatch(name):
            (folder / name).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # Of the folder itself, or one not empty.
                (folder / name).parent.rmdir()
    return written


def _write_pictures(
    folder: pathlib.Path, candidates: Sequence[Candidate], setting: Setting
) -> list[Written]:
    sheets, films = [], []
    for each in candidates:
        strips = [
            contact_sheet.Strip(index, each.episodes[index], film.thumbnails)
            for index, film in list(each.films.items())[: contact_sheet.MAX_ROWS]
        ]
        title = titles.title(each, setting)
        if len(strips) < len(each.episodes):
            title += f' · {len(strips)} are shown'
        sheets.append(each.path(CONTACT_SHEET))
        contact_sheet.save(
            folder / sheets[-1], strips, title, setting.control_timestep, setting.max_steps
        )
        for index, film in each.films.items():
            films.append(each.film_path(index))
            files.copy(film.path, folder / films[-1])
    if not films:
        return []
    return [
        Written(sheets, 'a row of pictures for each film'),
        Written(sorted(films), 'films'),
    ]


def _write_data(
    folder: pathlib.Path, candidates: Sequence[Candidate], setting: Setting
) -> list[Written]:
    for each in candidates:
        plots.save_progress(
            folder / each.path(PROGRESS),
            each.episodes,
            titles.title(each, setting),
            setting.control_timestep,
        )
        arrays = {**episode_lib.stack(each.episodes), **_states(each, setting)}
        files.save_arrays(folder / each.path(TRAJECTORIES), arrays, compressed=True)
    return [
        Written(
            [each.path(PROGRESS) for each in candidates],
            'distance and return over time',
        ),
        Written(
            [each.path(TRAJECTORIES) for each in candidates],
            'observations, actions and rewards',
        ),
    ]


def _states(candidate: Candidate, setting: Setting) -> dict[str, np.ndarray]:
    """Returns the physics of the filmed episodes at every control step; see `origin.load`."""
    if not candidate.films:
        return {}
    films = list(candidate.films.values())
    return {
        'filmed_seed': np.array([candidate.episodes[i].seed for i in candidate.films]),
        'physics': episode_lib.padded([film.physics for film in films]),
        'gripper_pose': episode_lib.padded([film.gripper_pose for film in films]),
        **{name: np.array(value) for name, value in setting.identity.names.items()},
    }
