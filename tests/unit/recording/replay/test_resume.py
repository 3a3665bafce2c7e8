"""A run says from where it went on."""

from pathlib import Path

import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.resume import find_resume_point
from tests.golden.drive import drive, record
from tests.golden.scenarios import rows
from tests.support.scripted_sources import Scripted

TICKS, EVERY = 40, 10
OPTIONS = RunOptions(
    source="scripted",
    body=Body(own=tuple("abcdef")),
    ticks=TICKS,
    threshold=0.06,
    keyframe_every=EVERY,
)
ROWS = rows(TICKS, 3)


def test_a_run_that_got_no_further_says_once_where_it_went_on(tmp_path: Path) -> None:
    past = None
    for life, until in enumerate((15, 15, 25)):
        log = tmp_path / f"{life}.mcap"
        driven = drive(OPTIONS, Scripted(ROWS), past=past, until=until)
        record(driven, OPTIONS, log, past)
        _, past = find_resume_point(log, min(until, driven.core.tick))
        assert past.resumed == ((15,), (15,), (15, 25))[life]
    driven = drive(OPTIONS, Scripted(ROWS), past=past)
    record(driven, OPTIONS, tmp_path / "end.mcap", past)
    assert Recording.open(tmp_path / "end.mcap").resumed == (15, 25)


@pytest.mark.parametrize("tick", [1, 9, 10, 11])
def test_it_goes_on_from_any_tick(tmp_path: Path, tick: int) -> None:
    driven = drive(OPTIONS, Scripted(ROWS), until=tick)
    record(driven, OPTIONS, tmp_path / "log.mcap")
    _, past = find_resume_point(tmp_path / "log.mcap", tick)
    assert (past.tick, past.resumed) == (tick, (tick,))
