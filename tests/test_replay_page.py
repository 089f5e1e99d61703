"""The page in which one walks around episodes: one file that stands alone."""

import base64
import html.parser
import re
import socket
import sys

import numpy as np
import pytest

viser = pytest.importorskip('viser', reason="needs pip install 'fetch_composer[explore]'")

import fetch_composer  # noqa: E402
from fetch_composer.explorer import run as run_lib  # noqa: E402
from fetch_composer.explorer.episodes import batch_rollout  # noqa: E402
from fetch_composer.explorer.pictures import solids  # noqa: E402
from fetch_composer.explorer.pictures.film import Film  # noqa: E402
from fetch_composer.explorer.report import replay_page  # noqa: E402
from fetch_composer.explorer.results.candidate import Candidate  # noqa: E402
from fetch_composer.tasks import TaskOptions  # noqa: E402
from tests import runs  # noqa: E402

_EVIL = '</script><script>alert("x")</script>$a_b$ & \'"'
_STEPS = 4


class _Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.elements, self.texts = [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.texts.append(data)

    def all(self, tag):
        return [attrs for each, attrs in self.elements if each == tag]


def _episodes(task_name, count=2, policy='random'):
    options = batch_rollout.EpisodeOptions(task_name, policy, TaskOptions(max_episode_steps=_STEPS))
    return batch_rollout.run_episodes(options, range(count))


def _candidate(policy, key, episodes, is_alone=False):
    films = {index: Film(None, (), None, None) for index in range(len(episodes))}
    return Candidate(policy, key, is_alone, lambda seed: None, episodes, films)


def _render(takes, task_name='push', title='push'):
    with fetch_composer.load(task_name, seed=0, max_episode_steps=_STEPS) as env:
        return replay_page.render(takes, env, 'corner', title)


@pytest.fixture(scope='module')
def takes():
    episodes = _episodes('push')
    return replay_page.takes_of([_candidate(each, f'1_{each}', episodes) for each in 'ab'])


@pytest.fixture(scope='module')
def text(takes):
    return _render(takes)


def _recordings(text):
    """Returns what viser's viewer is given to play, decoded as it decodes it."""
    import msgspec
    import zstandard

    found = []
    for data in re.findall('"([A-Za-z0-9+/=]{1000,})"', text):
        packed = base64.b64decode(data, validate=True)
        if packed[8:12] == b'\x28\xb5\x2f\xfd':  # As zstandard begins.
            plain = zstandard.ZstdDecompressor().decompress(packed[8:], 10**8)
            length = int.from_bytes(plain[:8], 'little')
            found.append(msgspec.msgpack.decode(plain[8 : 8 + length]))
    return found


def test_the_page_asks_for_nothing(text):
    page = _Page(text)
    links = [*page.all('link'), *page.all('a'), *page.all('img'), *page.all('script')]
    sources = [each[name] for each in links for name in ('href', 'src') if name in each]
    assert all(source.startswith('data:') for source in sources)
    linked = set(re.findall(r'(?:https?|wss?)://[\w.]+', text))
    assert linked <= {'http://www.w3.org'}  # The name of SVG.
    (policy,) = (each for each in page.all('meta') if 'http-equiv' in each)
    assert policy['content'].startswith("default-src 'none';")
    assert 'http' not in policy['content'] and '*' not in policy['content']


def test_each_episode_can_be_chosen_and_is_recorded(text, takes):
    page = _Page(text)
    assert [each['value'] for each in page.all('option')] == [each.key for each in takes]
    assert len({each.key for each in takes}) == len(takes) == 4
    recordings = _recordings(text)
    assert len(recordings) == len(takes)
    for recording in recordings:
        assert recording['durationSeconds'] >= _STEPS * 0.04


def test_a_single_episode_leaves_no_choice(takes):
    text = _render(takes[:1])
    assert not _Page(text).all('select')
    assert len(_recordings(text)) == 1


def test_things_move_as_they_did():
    (episode,) = _episodes('push', 1, 'expert')
    text = _render([replay_page.Take('one', 'one', episode)])
    (recording,) = _recordings(text)
    places = {}
    for _, message in recording['messages']:
        if message['type'] == 'SetPositionMessage':
            places[message['name']] = message['position']
    np.testing.assert_allclose(places['/block/block.'], episode.achieved_goal[-1], atol=1e-5)
    np.testing.assert_allclose(places['/target/target.'], episode.desired_goal[-1], atol=1e-5)
    assert '/fetch/fetch.gripper.gripper_link' in places
    names = [message.get('name') for _, message in recording['messages']]
    assert '/way of the gripper' in names


def test_the_same_episodes_give_the_same_page(text, takes):
    assert _render(takes) == text


def test_what_the_user_gave_is_text_and_never_markup(text):
    evil = replay_page.takes_of(
        [_candidate(f'{_EVIL}{number}', f'{number}_x', _episodes('push')) for number in (1, 2)]
    )
    page = _Page(_render(evil, title=_EVIL))
    assert len(page.all('script')) == len(_Page(text).all('script'))
    assert _EVIL in page.texts  # The title.
    assert any(f'{_EVIL}1' in each for each in page.texts)


@pytest.mark.parametrize('task', ('push', 'reach', 'push_two'))
def test_every_task_can_be_walked_around_in(task):
    episodes = _episodes(task, 1)
    assert _recordings(_render([replay_page.Take('one', 'one', episodes[0])], task))


def test_the_server_is_this_machines_own_and_is_gone_afterwards(takes, monkeypatch, capsys):
    made = []

    class Server(viser.ViserServer):
        def __init__(self, **kwargs):
            super().__init__(**kwargs)
            made.append((kwargs['host'], self.get_port()))

    monkeypatch.setattr(viser, 'ViserServer', Server)
    _render(takes[:1])
    ((host, port),) = made
    assert host == '127.0.0.1'
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, port), timeout=5)
    assert not capsys.readouterr().out


def _run(folder):
    run = run_lib.Run(runs.options(output_dir=str(folder), episodes=2), None)
    run.run()
    run.close()
    return run


@pytest.fixture
def filmed(monkeypatch):
    """Takes all episodes for filmed ones, since no film is taken here."""
    takes_of = replay_page.takes_of

    def all_takes(candidates):
        return takes_of([_candidate(each.policy, each.key, each.episodes) for each in candidates])

    monkeypatch.setattr(replay_page, 'takes_of', all_takes)


def test_a_run_writes_the_page_and_its_report_shows_it(tmp_path, filmed):
    run = _run(tmp_path)
    assert not run.remarks
    assert runs.names(tmp_path) == {'replay.html', *runs.PLAIN_FILES}
    page = _Page((tmp_path / 'report.html').read_text(encoding='utf-8'))
    assert [each['src'] for each in page.all('iframe')] == ['replay.html']
    assert 'replay.html' in [each.get('href') for each in page.all('a')]


@pytest.mark.parametrize('fault', ['missing', 'failing'])
def test_without_viser_a_run_succeeds_and_says_so_in_a_line(tmp_path, filmed, fault, monkeypatch):
    _run(tmp_path)
    if fault == 'missing':
        monkeypatch.setitem(sys.modules, 'viser', None)
        said = "No replay.html: viser is not installed: pip install 'fetch_composer[explore]'"
    else:
        monkeypatch.setattr(viser, 'ViserServer', lambda **_: 1 / 0)
        said = 'No replay.html: viser failed: ZeroDivisionError: division by zero'
    run = _run(tmp_path)
    assert run.remarks == [said]
    # That of the earlier run is gone, and the report has none.
    assert runs.names(tmp_path) == runs.PLAIN_FILES
    assert not _Page((tmp_path / 'report.html').read_text(encoding='utf-8')).all('iframe')


def test_solids_are_where_what_they_show_is():
    with fetch_composer.load('push', seed=0) as env:
        env.reset()
        physics = env.physics
        found = list(solids.of_model(physics.model))
        for solid in found:
            assert solid.faces.max() < len(solid.vertices)
            assert ((solid.rgba >= 0) & (solid.rgba <= 1)).all()
        (table,) = (each for each in found if each.name == 'table/table')
        corners = table.vertices + physics.data.xpos[table.body]
        np.testing.assert_allclose(np.ptp(corners, axis=0), [0.5, 0.7, 0.4], atol=1e-6)
        colours = {
            tuple(np.round(each.rgba, 2)) for each in found if each.name.startswith('fetch/')
        }
        assert len(colours) > 3  # Its palette is taken apart.
