"""A glance finds what a whole walk finds, wherever the file ends."""

from contextlib import suppress
from pathlib import Path

import msgspec
import pytest

from neurosnap.errors import RecordingError
from neurosnap.record.chunks import unpack
from neurosnap.record.glance import glance, go_on, sealed
from neurosnap.record.layout import Layout, opened
from neurosnap.record.scan import scan
from neurosnap.record.writer import Writer
from tests.unit.record.samples import traffic


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.mcap"
    with Writer(path, chunk=1500) as writer:
        writer.start({"source": "glance"})
        for place, delivery in enumerate(traffic(200)):
            writer.add(delivery, place)
        writer.finish({"ticks": "1"}, {})
    return path


def whole(log: Path, found: Layout) -> Layout:
    """Return a layout with what a glance leaves to whoever unpacks a chunk."""
    with opened(log) as file:
        chunks = [sealed(log, file, chunk) for chunk in found.chunks]
    return msgspec.structs.replace(found, chunks=chunks)


def test_a_finished_file_is_known_by_its_summary(log: Path) -> None:
    seen, scanned = glance(log), scan(log)
    assert seen.trouble is None
    found = whole(log, seen.layout)
    assert len(found.chunks) > 5
    for name in ("size", "library", "metadata", "attachments", "chunks", "channels"):
        assert getattr(found, name) == getattr(scanned, name)
    assert found.cut is None


def test_a_file_is_known_up_to_wherever_it_was_cut(log: Path) -> None:
    data = log.read_bytes()
    for size in range(60, len(data), 97):
        log.write_bytes(data[:size])
        scanned, seen = scan(log), glance(log)
        if seen.layout.metadata.keys() != scanned.metadata.keys():
            pytest.fail(f"metadata differs at {size}")
        assert whole(log, seen.layout).chunks == scanned.chunks
        assert seen.trouble is None
        assert seen.layout.cut is not None
        assert scanned.cut is not None
        assert seen.layout.cut.chunks == scanned.cut.chunks


def test_what_is_gained_is_found_from_where_the_walk_stopped(log: Path) -> None:
    data = log.read_bytes()
    log.write_bytes(data[:100])
    seen = glance(log)
    for size in [*range(150, len(data), 131), len(data)]:
        log.write_bytes(data[:size])
        assert go_on(log, seen)
        assert not go_on(log, seen)
        afresh = glance(log)
        assert whole(log, seen.layout).chunks == whole(log, afresh.layout).chunks
        assert (seen.layout.cut, seen.trouble) == (afresh.layout.cut, afresh.trouble)
    assert seen.layout.cut is None


def test_no_byte_can_be_wrong_unnoticed_in_what_is_shown(log: Path) -> None:
    data = log.read_bytes()
    intact = contents(log)
    for place in range(0, len(data), 29):
        hurt = bytearray(data)
        hurt[place] ^= 0x55
        log.write_bytes(hurt)
        try:
            assert contents(log) <= intact
        except RecordingError:
            assert place < 100  # the start: it is no recording of ours then


def contents(log: Path) -> set[bytes]:
    """Return what the chunks hold that can be read."""
    found = set()
    with opened(log) as file:
        for chunk in glance(log).layout.chunks:
            with suppress(RecordingError):
                found.add(unpack(log, file, sealed(log, file, chunk)))
    return found
