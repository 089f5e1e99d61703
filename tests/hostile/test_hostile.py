"""What `make soak` does for an hour, in some seconds, and the same each time."""

import pytest

pytest.importorskip('hypothesis')

from tests.hostile import __main__ as soak  # noqa: E402
from tests.hostile import endurance, faces, stores  # noqa: E402
from tests.hostile.tally import Tally  # noqa: E402

_COUNTS = {
    faces.options: 25,
    faces.gymnasium_resets: 100,
    stores.kills: 1,
    stores.damaged_stores: 3,
    stores.damaged_films: 30,
    endurance.singles: 16,
    endurance.batches: 8,
    endurance.leaks: 4,
}
_ALL = {**faces.ALL, **stores.ALL, **endurance.ALL}


@pytest.mark.parametrize('check', _ALL.values(), ids=_ALL.keys())
def test_what_is_given_is_refused_by_name_or_done_right(check):
    tally = Tally()
    check(tally, 0, _COUNTS.get(check, 150))
    assert tally.tried > 0


def test_a_defect_is_found_counted_and_written_down(tmp_path, monkeypatch):
    def fail(tally, seed, count):
        tally.add(was_refused=True)
        raise RuntimeError(f'raw, in round {seed}')

    monkeypatch.setattr(faces, 'ALL', {'what fails': fail})
    monkeypatch.setattr(stores, 'ALL', {})
    monkeypatch.setattr(endurance, 'ALL', {})
    tallies = soak.soak(60, 5, tmp_path)
    assert len(tallies['what fails'].defects) == soak._MOST_DEFECTS
    assert 'raw, in round 5' in (tmp_path / 'defect_001.txt').read_text()
    assert '| what fails | 100 | 100 | 100 |' in soak.table(tallies, 60, 5)
