"""The report of a run: one page of HTML that needs no other file and no network."""

import base64
import io
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import jinja2
import numpy as np
from PIL import Image

from fetch_composer.explorer import flags
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.options import Options
from fetch_composer.explorer.pictures import charts, style, top_view
from fetch_composer.explorer.report import replay_page
from fetch_composer.explorer.results import compare, statistics, writing
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting
from fetch_composer.tasks import action_modes

MOST_FILMS = replay_page.MOST  # Within the page; more of them stay beside it.
FIRST_ROWS = 50  # Of the episodes, before one asks for more.
MOST_ROWS = 1000
_TEMPLATE = 'report.html.j2'
_THUMBNAIL_QUALITY = 82


def render(
    options: Options,
    candidates: Sequence[Candidate],
    comparisons: Sequence[compare.Comparison],
    setting: Setting,
    versions: Mapping[str, str | None],
    stopped: bool,
    has_replay: bool = False,
) -> str:
    """Returns the page; the same results give the same page.

    Args:
        options: What was asked for.
        candidates: The policies, with one finished episode or more each.
        comparisons: Of the first policy with each other.
        setting: What is to be said of the task.
        versions: Versions of what decides on an episode.
        stopped: Whether the run was stopped before its end.
        has_replay: Whether the page that replays its films' episodes is beside it.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters['percent'] = lambda value: f'{100 * value:.1f} %'
    environment.filters['cm'] = _centimetres
    environment.filters['signed'] = lambda value, digits=1: f'{value:+.{digits}f}'
    episodes = [each for candidate in candidates for each in candidate.episodes]
    shown = list(dict.fromkeys(i for each in candidates for i in each.films))[:MOST_FILMS]
    return environment.get_template(_TEMPLATE).render(
        style=style,
        options=options,
        setting=setting,
        seeds=(min(e.seed for e in episodes), max(e.seed for e in episodes)),
        candidates=[_figures(each) for each in candidates],
        comparisons=[_comparison(each, candidates) for each in comparisons],
        films=[_film_card(index, options, candidates, setting) for index in shown],
        films_left=sum(len(each.films) for each in candidates) - len(shown) * len(candidates),
        plots=_plots(candidates, setting),
        rows=_rows(options, candidates, shown)[:MOST_ROWS],
        first_rows=FIRST_ROWS,
        rows_left=max(0, max(len(each.episodes) for each in candidates) - MOST_ROWS),
        versions=versions,
        stopped=stopped,
        replay=writing.REPLAY if has_replay else None,
    )


def _centimetres(metres: float) -> str:
    return f'{100 * metres:.{1 if metres >= 0.01 else 2}f} cm'


def _figures(candidate: Candidate) -> dict[str, Any]:
    episodes = candidate.episodes
    return {
        'policy': candidate.policy,
        'episodes': len(episodes),
        'reached': sum(each.is_success for each in episodes),
        'success': statistics.success_rate([each.is_success for each in episodes]),
        'final_distance': float(np.median([each.distance[-1] for each in episodes])),
        'worst_distance': float(np.max([each.distance[-1] for each in episodes])),
        'total_reward': float(np.mean([each.total_reward for each in episodes])),
    }


def _comparison(comparison: compare.Comparison, candidates: Sequence[Candidate]) -> dict[str, Any]:
    of_policy = {each.policy: each.episodes for each in candidates}
    pairs = compare.paired(of_policy[comparison.first], of_policy[comparison.second])
    plot = charts.paired_distances(
        pairs, _shortened(comparison.first), _shortened(comparison.second)
    )
    return {'figures': comparison, 'plot': _data_url('image/svg+xml', plot.encode())}


def _shortened(policy: str, most: int = 32) -> str:
    return policy if len(policy) <= most else f'…{policy[1 - most :]}'


def _plots(candidates: Sequence[Candidate], setting: Setting) -> list[dict[str, Any]]:
    """Returns the plots of all episodes: by subject, one for each policy, to the same scale."""
    step = setting.control_timestep
    components = action_modes.MODES[setting.identity.action_mode].components
    highest_cm = 100 * max(e.distance.max() for each in candidates for e in each.episodes)
    furthest_cm = 100 * max(e.distance[-1] for each in candidates for e in each.episodes)

    def of_each(draw) -> list[dict[str, str]]:
        return [
            {
                'policy': each.policy,
                'image': _data_url('image/svg+xml', draw(each.episodes).encode()),
            }
            for each in candidates
        ]

    return [
        {
            'title': 'Distance to the goal',
            'note': 'A line for each episode: blue ends at the goal, orange elsewhere.',
            'images': of_each(lambda x: charts.distance_over_time(x, step, highest_cm)),
        },
        {
            'title': 'Final distances',
            'note': 'Where the episodes end, all in one histogram.',
            'images': of_each(lambda x: charts.final_distances(x, furthest_cm)),
        },
        {
            'title': 'The table from above',
            'note': 'Paths on the table, from start to end, of all episodes.',
            'images': of_each(
                lambda x: top_view.top_view(x, setting.workspace, setting.has_object)
            ),
        },
        {
            'title': 'Actions',
            'note': 'Median and the range from 10 to 90 %, in units of an action.',
            'images': of_each(lambda x: charts.actions_over_time(x, step, components)),
        },
    ]


def _film_card(
    index: int, options: Options, candidates: Sequence[Candidate], setting: Setting
) -> dict[str, Any]:
    takes: list[dict[str, Any]] = []
    for each in candidates:
        if index not in each.films:
            continue
        film, episode = each.films[index], each.episodes[index]
        view = top_view.top_view([episode], setting.workspace, setting.has_object)
        takes.append(
            {
                'policy': each.policy,
                'key': replay_page.key(each, index),
                'episode': episode,
                'video': _data_url('video/mp4', film.path.read_bytes()),
                'poster': _jpeg(film.thumbnails[0]),
                'thumbnails': [_jpeg(image) for image in film.thumbnails],
                'top_view': _data_url('image/svg+xml', view.encode()),
            }
        )
    seed = takes[0]['episode'].seed
    policies = [each.policy for each in candidates]
    return {
        'index': index,
        'seed': seed,
        'takes': takes,
        'command': flags.replay_command(options, policies, seed),
    }


def _rows(
    options: Options, candidates: Sequence[Candidate], shown: Sequence[int]
) -> list[dict[str, Any]]:
    """Returns a row for each seed, those with most failures and then the furthest ones first."""
    by_seed: dict[int, list[Episode | None]] = {}
    for column, candidate in enumerate(candidates):
        for episode in candidate.episodes:
            by_seed.setdefault(episode.seed, [None] * len(candidates))[column] = episode
    policies, rows = [each.policy for each in candidates], []
    for seed, results in by_seed.items():
        index = seed - options.seed
        done = [each for each in results if each is not None]
        rows.append(
            {
                'seed': seed,
                'results': results,
                'failures': sum(not each.is_success for each in done),
                'furthest': max(each.distance[-1] for each in done),
                'card': index if index in shown else None,
                'files': [
                    each.film_path(index) for each in candidates
                    if index in each.films and index not in shown
                ],
                'command': flags.replay_command(options, policies, seed),
            }
        )  # fmt: skip
    return sorted(rows, key=lambda row: (-row['failures'], -row['furthest'], row['seed']))


def _jpeg(image: Image.Image) -> str:
    data = io.BytesIO()
    image.save(data, 'JPEG', quality=_THUMBNAIL_QUALITY)
    return _data_url('image/jpeg', data.getvalue())


def _data_url(kind: str, data: bytes) -> str:
    return f'data:{kind};base64,{base64.b64encode(data).decode()}'
