"""The files of a run, in its folder."""

import contextlib
import dataclasses
import pathlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    r'(replay|report)\.html|(\d+_[\w.-]+/)?(trajectories\.npz|progress\.png|contact_sheet\.png|episode_\d{3,}\.mp4)'
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
    make_pages: Mapping[str, Callable[[], str | None]],
    summary: Mapping[str, Any],
    remarks: list[str],
) -> list[Written]:
    """Writes what a run has found, and removes what an earlier one in its folder has left.

    Data comes first. A picture or page that fails is missing, and nothing else is.

    Args:
        folder: The folder, which is there.
        candidates: The policies, with one finished episode or more each.
        setting: What is to be said of the task.
        make_pages: What makes the report and the page that replays, by name and in this order;
            they return None for one that there is not.
        summary: The figures; the names of all files are added to them.
        remarks: A line is added for each picture or page that has failed.

    Returns:
        The files, those to open first at the front.

    Raises:
        OSError: if something cannot be written.
    """
    before = _own_names(files.load_json(folder / SUMMARY).get('files'))
    for each in candidates:
        (folder / each.path('')).mkdir(exist_ok=True)
    figures = Written((SUMMARY,), 'figures, versions and flags')
    data = _write_data(folder, candidates, setting)
    # Should this be all, the next run still knows what an earlier one has left.
    names = [*data.names, *figures.names]
    files.save_json(folder / SUMMARY, {**summary, 'files': [*names, *sorted(before - {*names})]})

    pictures = _write_pictures(folder, candidates, setting, remarks)
    pages = []
    for name, make in make_pages.items():
        with _failing_alone(name, remarks):
            page = make()
            if page is not None:
                files.save_text(folder / name, page)
                pages.append(Written((name,), _OF_PAGES[name]))
    pages.sort(key=lambda each: list(_OF_PAGES).index(each.names[0]))
    written = [*pages, *pictures, data, figures]
    names = [name for each in written for name in each.names]
    files.save_json(folder / SUMMARY, {**summary, 'files': names})

    # A film of an earlier and longer run would be taken for one of this run.
    for name in before - set(names):
        with contextlib.suppress(OSError):  # Of what is no file any more.
            (folder / name).unlink(missing_ok=True)
            (folder / name).parent.rmdir()  # Unless it is the run's own, or not empty.
    return written


def _own_names(names: Any) -> set[str]:
    """Returns those names in a summary, which anyone may have written, that a run gives."""
    found = names if isinstance(names, list) else []
    return {each for each in found if isinstance(each, str) and _OWN_NAME.fullmatch(each)}


@contextlib.contextmanager
def _failing_alone(name: str, remarks: list[str]) -> Iterator[None]:
    """Turns a failure into a remark, unless files cannot be written at all."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:  # Of whatever draws.
        remarks.append(f'No {name}: {type(error).__name__}: {error}')


def _write_pictures(
    folder: pathlib.Path, candidates: Sequence[Candidate], setting: Setting, remarks: list[str]
) -> list[Written]:
    sheets, films, progress = [], [], []
    for each in candidates:
        name = each.path(PROGRESS)
        with _failing_alone(name, remarks):
            title = titles.title(each, setting)
            plots.save_progress(folder / name, each.episodes, title, setting.control_timestep)
            progress.append(name)
    for each in candidates:
        if not each.films:
            continue
        strips = [
            contact_sheet.Strip(index, each.episodes[index], film.thumbnails)
            for index, film in list(each.films.items())[: contact_sheet.MAX_ROWS]
        ]
        title = titles.title(each, setting)
        if len(strips) < len(each.episodes):
            title += f' · {len(strips)} are shown'
        name = each.path(CONTACT_SHEET)
        with _failing_alone(name, remarks):
            contact_sheet.save(
                folder / name, strips, title, setting.control_timestep, setting.max_steps
            )
            sheets.append(name)
        for index, film in each.films.items():
            films.append(each.film_path(index))
            files.copy(film.path, folder / films[-1])
    kinds = [
        Written(sheets, 'a row of pictures for each film'),
        Written(sorted(films), 'films'),
        Written(progress, 'distance and return over time'),
    ]
    return [each for each in kinds if each.names]


def _write_data(folder: pathlib.Path, candidates: Sequence[Candidate], setting: Setting) -> Written:
    for each in candidates:
        arrays = {**episode_lib.stack(each.episodes), **_states(each, setting)}
        files.save_arrays(folder / each.path(TRAJECTORIES), arrays, compressed=True)
    names = [each.path(TRAJECTORIES) for each in candidates]
    return Written(names, 'observations, actions and rewards')


def _states(candidate: Candidate, setting: Setting) -> dict[str, np.ndarray]:
    """Returns the physics of the filmed episodes at every control step; see `origin.load`."""
    if not candidate.films:
        return {}
    films = list(candidate.films.values())
    return {
        'filmed_seed': episode_lib.seed_array(
            [candidate.episodes[i].seed for i in candidate.films]
        ),
        'physics': episode_lib.padded([film.physics for film in films]),
        'gripper_pose': episode_lib.padded([film.gripper_pose for film in films]),
        **{name: np.array(value) for name, value in setting.identity.names.items()},
    }
