"""A page in which one walks around chosen episodes: turns, zooms, and scrubs through them.

viser makes it: its viewer, a script of its own, is within the page, and so are the recordings. The
page asks for nothing else. Only while it is made viser listens, for this machine alone.
"""

import base64
import contextlib
import dataclasses
import html
import io
import itertools
import pathlib
import re
import threading
from collections.abc import Iterator, Sequence
from typing import Any

import jinja2
import numpy as np

from fetch_composer.explorer.episodes import replay
from fetch_composer.explorer.episodes.episode import Episode
from fetch_composer.explorer.pictures import style
from fetch_composer.explorer.results.candidate import Candidate
from fetch_composer.tasks import layout

MOST = 24  # Seeds; with more, the page would take long to open.
_TEMPLATE = 'replay.html.j2'
_LOOPBACK = '127.0.0.1'
# Nothing is loaded from anywhere, whatever the viewer might ask for.
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
    "script-src 'unsafe-inline' 'unsafe-eval' blob: data:; style-src 'unsafe-inline'; "
    'img-src data: blob:; font-src data:; worker-src blob: data:; connect-src data: blob:">'
)
_LINE_WIDTH = 0.006  # m
_LINE_COLOUR = (240, 180, 0)
_DISTANCE = 1.3  # m from the camera to what it turns about.
_LEAST_MOTION = 1e-6  # m, or of a quaternion.
_SECONDS_TO_STOP = 10
_REST = 0.6  # s at the end, before it begins anew.


class ReplayPageError(RuntimeError):
    """The page cannot be made."""


@dataclasses.dataclass(frozen=True)
class Take:
    """An episode of the page.

    Attributes:
        key: What names it in the address of the page, after the #.
        title: What it is called.
        episode: The episode.
    """

    key: str
    title: str
    episode: Episode

    @property
    def way(self) -> np.ndarray:
        """(T + 1, 3) places of the gripper in m."""
        return self.episode.observation[:, layout.WITH_OBJECT.grip_position]


def takes_of(candidates: Sequence[Candidate]) -> list[Take]:
    """Returns the filmed episodes of some policies, those to look at first at the front."""
    indices = list(dict.fromkeys(index for each in candidates for index in each.films))[:MOST]
    takes = []
    for index, each in itertools.product(indices, candidates):
        if index in each.films:
            episode = each.episodes[index]
            who = '' if each.is_alone else f' · {each.policy}'
            end = 'at the goal' if episode.is_success else 'not at the goal'
            takes.append(Take(key(each, index), f'Seed {episode.seed}{who} · {end}', episode))
    return takes


def key(candidate: Candidate, index: int) -> str:
    """Returns what names an episode in the page's address, after the #."""
    return f'{candidate.key}_{index}'


def render(takes: Sequence[Take], env: Any, camera: str, title: str) -> str:
    """Returns the page.

    Args:
        takes: The episodes, one or more; the first is shown until another is chosen.
        env: A single environment of the options that they were run with.
        camera: Name of the camera from which one looks at first.
        title: Title of the page.

    Raises:
        ReplayPageError: if viser is not installed, or fails.
        ReplayError: if an episode does not end as it did.
    """
    try:
        import viser

        from fetch_composer.explorer.pictures import solids
    except ImportError as error:
        raise ReplayPageError(
            f"{error.name} is not installed: pip install 'fetch_composer[explore]'"
        ) from None
    paths = [_path(env, take.episode) for take in takes]
    try:
        shown = list(solids.of_model(env.physics.model))
        with _server(viser) as server:
            _look(server, env.physics, camera)
            frames = _build(server, env.physics.model, shown)
            recordings: dict[str, str] = {}
            page = ''
            for take, path in zip(takes, paths, strict=True):
                recording = _record(server, frames, path, take.way, env.control_timestep())
                if not page:
                    page = recording.as_html()
                else:
                    recordings[take.key] = base64.b64encode(recording.serialize()).decode()
    except Exception as error:  # Of its sockets and threads, or of a model it cannot show.
        raise ReplayPageError(f'viser failed: {type(error).__name__}: {error}') from error
    return _completed(page, takes, recordings, title)


def _path(env: Any, episode: Episode) -> np.ndarray:
    """Returns (T + 1, bodies, 7): position and quaternion of each body at each step."""
    data, poses = env.physics.data, []
    replay.replay(
        env, episode, lambda step: poses.append(np.concatenate((data.xpos, data.xquat), axis=1))
    )
    return np.stack(poses)


@contextlib.contextmanager
def _server(viser: Any) -> Iterator[Any]:
    """Gives a server on this machine's own address; what it has to say is kept quiet."""
    before = set(threading.enumerate())
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=_LOOPBACK, port=0, verbose=False)
        try:
            yield server
        finally:
            server.stop()
            for each in set(threading.enumerate()) - before:  # It says so last of all.
                each.join(_SECONDS_TO_STOP)


def _look(server: Any, physics: Any, camera: str) -> None:
    """Looks from a camera of the model at the scene."""
    index = physics.model.name2id(camera, 'camera')
    place, turn = physics.data.cam_xpos[index], physics.data.cam_xmat[index].reshape(3, 3)
    server.scene.set_up_direction('+z')
    server.initial_camera.position = place
    server.initial_camera.look_at = place - _DISTANCE * turn[:, 2]
    server.initial_camera.fov = float(np.radians(physics.model.cam_fovy[index]))


def _build(server: Any, model: Any, shown: Sequence[Any]) -> dict[int, Any]:
    """Adds a frame for each body that shows something, and its solids; returns the frames."""
    frames: dict[int, Any] = {}
    for number, solid in enumerate(shown):
        body = model.id2name(solid.body, 'body')
        owner, _, _ = body.partition('/')
        name = f'/{owner}/{body.replace("/", ".")}'
        if solid.body not in frames:
            frames[solid.body] = server.scene.add_frame(name, show_axes=False)
        opacity = float(solid.rgba[3])
        server.scene.add_mesh_simple(
            f'{name}/{number}',
            solid.vertices.astype(np.float32),
            solid.faces.astype(np.uint32),
            color=tuple(int(round(255 * each)) for each in solid.rgba[:3]),
            opacity=opacity if opacity < 1 else None,
        )
    return frames


def _record(
    server: Any, frames: dict[int, Any], path: np.ndarray, way: np.ndarray, seconds: float
) -> Any:
    """Returns viser's recording of an episode.

    Args:
        server: Its server.
        frames: Frame of each body that is to be moved.
        path: What `_path` returns.
        way: (T + 1, 3) where the gripper was.
        seconds: Time of a step.
    """
    _move(frames, path[0], None)
    server.scene.add_line_segments(
        '/way of the gripper',
        np.stack((way[:-1], way[1:]), axis=1).astype(np.float32),
        _LINE_COLOUR,
        thickness=_LINE_WIDTH,
    )
    recording = server.get_scene_serializer()
    for before, poses in zip(path[:-1], path[1:], strict=True):
        recording.insert_sleep(seconds)
        _move(frames, poses, before)
    recording.insert_sleep(_REST)
    return recording


def _move(frames: dict[int, Any], poses: np.ndarray, before: np.ndarray | None) -> None:
    """Moves the frames of those bodies that are elsewhere than before."""
    for body, frame in frames.items():
        if before is None or np.abs(poses[body] - before[body]).max() > _LEAST_MOTION:
            frame.position, frame.wxyz = poses[body, :3], poses[body, 3:]


def _completed(page: str, takes: Sequence[Take], recordings: dict[str, str], title: str) -> str:
    """Returns viser's page with a title, the other recordings, and what chooses among them."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    chooser = environment.get_template(_TEMPLATE).render(
        takes=takes, recordings=recordings, style=style
    )
    page = re.sub('<title>[^<]*</title>', lambda _: f'<title>{html.escape(title)}</title>', page)
    for mark, text in (('<head>', _POLICY), ('<body>', chooser)):
        before, found, after = page.partition(mark)
        if not found:
            raise ReplayPageError(f'viser has written a page without {mark}')
        page = f'{before}{mark}{text}{after}'
    return page
