"""A recording that is taken away while it is written."""

import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.rotation import SplitWriter
from tests.support.recordings import NOW

RULE = "log: must stay where it is while it is written"


def add(writer: SplitWriter, number: int) -> None:
    leave = wire.Leave("world")
    writer.add(wire.Delivery(leave.key, number, NOW, wire.encode(leave)), NOW)


def replace(log: Path) -> None:
    log.unlink()
    log.write_bytes(b"another")


def move_folder(log: Path) -> None:
    log.parent.rename(log.parent.with_name("moved"))


@pytest.mark.parametrize(
    ("take", "left"),
    [
        (Path.unlink, "runs/log.mcap"),
        (replace, "runs/log.recovered-1.mcap"),
        (lambda log: log.rename(log.with_name("b.mcap")), "runs/b.mcap"),
        (move_folder, "moved/log.mcap"),
    ],
    ids=["deleted", "replaced", "moved", "folder moved"],
)
@pytest.mark.parametrize(
    ("flushes", "ends"), [(True, True), (True, False), (False, True)]
)
def test_it_is_said_at_the_next_flush_or_the_end_and_nothing_is_lost(
    take: Callable[[Path], None],
    left: str,
    flushes: bool,
    ends: bool,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.ERROR, "neurosnap")
    log = tmp_path / "runs" / "log.mcap"
    log.parent.mkdir()
    with SplitWriter(log, {}) as writer:
        add(writer, 0)
        writer.flush(NOW)
        assert not caplog.records
        take(log)
        add(writer, 1)
        for _ in range(3 * flushes):
            writer.flush(NOW)
        assert len(caplog.records) == flushes
        if ends:
            balance = writer.finish({}, {"world": 2})
            assert balance.missing == {}
            assert balance.vanished == (str(log),)
            assert not balance.whole
        assert caplog.records[0].getMessage().startswith(RULE)
    assert len(list(Recording.open(tmp_path / left).messages())) == 2
    if left == "runs/log.recovered-1.mcap":
        assert log.read_bytes() == b"another"
