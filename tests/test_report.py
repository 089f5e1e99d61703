"""The report: one page that stands alone."""

import dataclasses
import html.parser
import json
import re
import shlex

import numpy as np
import pytest
from PIL import Image

from fetch_composer.explorer import flags
from fetch_composer.explorer import run as run_lib
from fetch_composer.explorer.episodes import batch_rollout
from fetch_composer.explorer.options import Options
from fetch_composer.explorer.pictures.film import Film
from fetch_composer.explorer.report import page as page_lib
from fetch_composer.explorer.report import replay_page
from fetch_composer.explorer.results import compare, statistics
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.explorer.results.setting import Setting
from fetch_composer.tasks import TaskOptions, is_success, registry
from fetch_composer.tasks.state import Identity

_EVIL = '<script>alert("x")</script>$a_b$ & \'"'
_VOID = {'meta', 'img', 'br', 'link', 'input', 'hr'}


class _Page(html.parser.HTMLParser):
    """Reads a page, and makes sure that its elements are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.text, self._open = [], '', []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in _VOID:
            self._open.append(tag)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def all(self, tag, name):
        return [attrs[name] for each, attrs in self.elements if each == tag and name in attrs]


def _options(**changes):
    small = {
        'policy': ['random'], 'episodes': 4, 'seed': 3, 'max_episode_steps': 6, 'num_films': 2,
        'width': 96, 'height': 64, 'output_dir': 'out folder',
    }  # fmt: skip
    return flags.make_options({**small, **changes})


def _candidate(policy, episodes, films=None, is_alone=True):
    def make_policy(seed):
        raise AssertionError('A report needs no policy.')

    return Candidate(policy, f'1_{policy}', is_alone, make_policy, episodes, films or {})


@pytest.fixture(scope='module')
def episodes():
    options = _options().of_episodes('random')
    return batch_rollout.run_episodes(options, range(3, 7))


@pytest.fixture(scope='module')
def setting():
    task = registry.make('push')
    identity = Identity('push', 'documented', 'displacement', '', '3', shapes={})
    return Setting('push', 'documented', task.workspace, True, 0.04, 3, identity)


def _film(tmp_path):
    path = tmp_path / 'film.mp4'
    path.write_bytes(b'a film')
    thumbnails = [Image.fromarray(np.zeros((8, 12, 3), np.uint8))] * 3
    return Film(path, thumbnails, np.zeros((4, 30)), np.zeros((4, 7)))


def _render(options, candidates, setting, comparisons=(), **flags):
    given = {'stopped': False, **flags}
    return page_lib.render(options, candidates, comparisons, setting, {'mujoco': '3'}, **given)


def test_the_page_needs_nothing_beside_it(tmp_path, episodes, setting):
    films = {2: _film(tmp_path), 0: _film(tmp_path)}
    text = _render(_options(), [_candidate('random', episodes, films)], setting)
    page = _Page(text)
    sources = [*page.all('img', 'src'), *page.all('video', 'src'), *page.all('video', 'poster')]
    assert len(page.all('video', 'src')) == 2
    assert all(source.startswith('data:') for source in sources)
    assert not page.all('link', 'href') and not page.all('script', 'src')
    assert '://' not in text
    ids = set(page.all('article', 'id'))
    assert ids == {'film-2', 'film-0'}
    assert set(page.all('a', 'href')) == {f'#{each}' for each in ids}


def test_a_row_for_each_episode_failures_and_the_furthest_first(episodes, setting):
    page = _Page(_render(_options(), [_candidate('random', episodes)], setting))
    rows = [tag for tag, _ in page.elements].count('details')
    assert rows == len(episodes)
    order = sorted(episodes, key=lambda each: (each.is_success, -each.distance[-1]))
    first = page.text.index(f'{100 * order[0].distance[-1]:.1f} cm', page.text.index('Episodes,'))
    last = page.text.index(f'{100 * order[-1].distance[-1]:.1f} cm', page.text.index('Episodes,'))
    assert first < last
    assert '95 % interval: 0.0 to 49.0 %' in page.text


def _parsed(command):
    words = shlex.split(command)
    assert words[:3] == ['python', '-m', 'fetch_composer.explorer']
    parser = flags.parser()
    assert parser(words[2:]) == [words[2]]
    return flags.make_options(flags.option_values(parser))


def test_the_command_of_an_episode_films_exactly_that_one():
    options = _options(
        policy=['random', "it's"], task='pick_and_place', reward_type='dense', fps=50,
        camera='side', object_position=[1.3, 0.75], goal=[1.3, 0.8, 0.5], trust_pickle=True,
        convention='gymnasium_robotics', **{'import': ['one', 'other.two']},
    )  # fmt: skip
    replayed = _parsed(flags.replay_command(options, options.policy, 5))
    assert replayed == dataclasses.replace(
        options, seed=5, episodes=1, num_films=5, output_dir='out folder/seed_5'
    )


def test_the_command_of_an_episode_says_no_more_than_it_must():
    options = flags.make_options({'ray': 'local', 'num_envs': 3, 'films': 'none'})
    assert flags.replay_command(options, options.policy, 2) == (
        'python -m fetch_composer.explorer --task=push --policy=expert --episodes=1 --seed=2 '
        '--output_dir=output/push_expert/seed_2'
    )


def test_every_option_of_a_run_is_a_flag_with_a_text():
    parser = flags.parser()
    names = {each.name for each in dataclasses.fields(Options)} - {'task_options', 'imports'}
    names |= {each.name for each in dataclasses.fields(TaskOptions)} - {
        'observation_mode', 'pixels', 'variations'
    }  # fmt: skip
    assert set(flags.option_values(parser)) == {*names, 'import'}
    assert all(parser[name].help for name in parser)
    assert flags.make_options(flags.option_values(parser)) == Options()


def test_the_same_results_give_the_same_page(tmp_path, episodes, setting):
    def page():
        films = {1: _film(tmp_path)}
        return _render(_options(), [_candidate('random', episodes, films)], setting)

    assert page() == page()


def test_the_page_shows_the_one_in_3d_that_is_beside_it(tmp_path, episodes, setting):
    films = {2: _film(tmp_path), 0: _film(tmp_path)}
    candidates = [_candidate('random', episodes, films)]
    text = _render(_options(), candidates, setting, has_replay=True)
    page = _Page(text)
    assert page.all('iframe', 'src') == ['replay.html']
    links = [each for each in page.all('a', 'href') if each.startswith('replay.html')]
    keys = {take.key for take in replay_page.takes_of(candidates)}
    assert set(links) == {'replay.html', *(f'replay.html#{key}' for key in keys)}
    assert '://' not in text


def test_what_the_user_gave_is_text_and_never_markup(tmp_path, episodes, setting):
    options = _options(policy=(_EVIL, 'random'), output_dir=f'out/{_EVIL}')
    films = {1: _film(tmp_path)}
    candidates = [_candidate(policy, episodes, films, is_alone=False) for policy in options.policy]
    compared = [compare.compare(_EVIL, episodes, 'random', episodes)]
    text = _render(options, candidates, setting, compared, stopped=True, has_replay=True)
    page = _Page(text)
    assert [tag for tag, _ in page.elements].count('script') == 1
    assert 'alert("x")' not in re.sub('<script>.*', '', text.replace('&#34;', '&quot;'), flags=re.S)
    assert _EVIL in page.text
    assert 'stopped before its end' in page.text
    assert 'Compared on the same seeds' in page.text


@pytest.mark.parametrize('count', [1, 2])
def test_few_episodes_are_reported_too(episodes, setting, count):
    candidates = [_candidate('random', episodes[:count])]
    assert 'All episodes' in _render(_options(episodes=count), candidates, setting)


def test_long_lists_are_cut_and_say_so(episodes, setting, monkeypatch):
    monkeypatch.setattr(page_lib, 'MOST_ROWS', 3)
    page = _Page(_render(_options(), [_candidate('random', episodes)], setting))
    assert [tag for tag, _ in page.elements].count('details') == 3
    assert '1 more episodes are listed in summary.json' in page.text


def test_many_episodes_are_folded_away(episodes, setting, monkeypatch):
    monkeypatch.setattr(page_lib, 'FIRST_ROWS', 1)
    page = _Page(_render(_options(), [_candidate('random', episodes)], setting))
    assert [tag for tag, _ in page.elements].count('details') == 4 + 1
    assert 'Show 3 more' in page.text


def test_films_beyond_the_page_are_linked(tmp_path, episodes, setting, monkeypatch):
    monkeypatch.setattr(page_lib, 'MOST_FILMS', 1)
    films = {2: _film(tmp_path), 0: _film(tmp_path)}
    page = _Page(_render(_options(), [_candidate('random', episodes, films)], setting))
    assert set(page.all('a', 'href')) == {'#film-2', 'episode_000.mp4'}
    assert '1 more films lie beside this page' in page.text


def test_a_run_of_each_task_writes_its_report(tmp_path, task_name):
    options = _options(task=task_name, policy=['random', 'zero'], output_dir=str(tmp_path))
    run = run_lib.Run(options, None)
    run.run()
    run.close()
    page = _Page((tmp_path / 'report.html').read_text(encoding='utf-8'))
    assert task_name in page.text
    summary = json.loads((tmp_path / 'summary.json').read_text())
    (comparison,) = summary['comparisons']
    assert (comparison['first'], comparison['second']) == ('random', 'zero')
    assert comparison['seeds'] == 4
    successes = {}
    for number, policy in enumerate(options.policy, start=1):
        with np.load(tmp_path / f'{number}_{policy}' / 'trajectories.npz') as file:
            successes[policy] = is_success(file['achieved_goal'], file['desired_goal'])[:, -1]
    for each in summary['policies']:
        rate = statistics.success_rate(successes[each['policy']])
        assert each['success_rate'] == rate.value
        assert each['success_interval'] == [rate.low, rate.high]
    difference = statistics.success_difference(successes['random'], successes['zero'])
    assert comparison['success_difference'] == dataclasses.asdict(difference)
    assert set(summary['files']) == {
        str(path.relative_to(tmp_path)) for path in tmp_path.rglob('*') if path.is_file()
    }
