"""A recording that grows tells what a whole one does, each once."""

from pathlib import Path

import msgspec
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.anomaly_feed import Fed, _Growing, recorded
from tests.support.lamp import BIRTH, lamp_options
from tests.support.recorded_runs import csv_run
from tests.support.recorded_runs import recorded as made


def written(log: Path, whole: Recording, messages: list[Recorded]) -> None:
    """Write messages as a recorder that has not ended."""
    with Writer(log) as writer:
        writer.start(whole.metadata)
        for each in messages:
            writer.add(each.delivery, each.log_time)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["anomalies", "births"])
def test_a_recording_that_grows_and_is_begun_anew_tells_each_once(
    kind: str, tmp_path: Path
) -> None:
    options = csv_run(tmp_path / "readings.csv")
    changes: dict[str, object] = {"watch": True, "support": 0}
    if kind == "births":
        options, changes = lamp_options(ticks=BIRTH + 2), {"cells": "inline"}
    options = msgspec.structs.replace(options, **changes)
    whole = Recording.open(made(options, tmp_path / "whole.mcap"))
    told, messages = [*recorded(whole)], [*whole.messages()]
    assert told
    log, heard = tmp_path / "log.mcap", list[Fed]()
    growing = _Growing(log, None)
    assert [*growing.catch_up(), *growing.look()] == []  # it has not begun
    for end in range(len(messages) // 3, len(messages), len(messages) // 3):
        log.unlink(missing_ok=True)  # as where a run goes on after a death
        assert growing.look() == []
        written(log, whole, messages[:end])
        heard += growing.look()
        assert growing.look() == []
        assert heard == told[: len(heard)]
    (tmp_path / "whole.mcap").replace(log)
    assert [*heard, *growing.look()] == told
    assert growing.has_end
    late = _Growing(log, None)
    assert [*late.catch_up(), *late.look()] == []


def test_a_run_that_reports_nothing_is_refused(tmp_path: Path) -> None:
    options = csv_run(tmp_path / "readings.csv", 2)
    log = made(msgspec.structs.replace(options, watch=False), tmp_path / "log.mcap")
    with pytest.raises(InvalidValueError, match="must be run with --anomalies or"):
        _Growing(log, None).catch_up()
