"""Recordings of runs with unknown readings, and with reports that were refused."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.scripted_sources import Live, Scripted

TICKS = 20


def rows(*, unknown: bool) -> list[list[bool | None]]:
    return implying_rows(2 * TICKS, 0, 0.5 if unknown else 0.0)


def record(
    source: Scripted,
    log: Path,
    workers: int = 0,
    past: ResumePoint | None = None,
    ticks: int = TICKS,
) -> Path:
    """Record a run in one process."""
    return record_scripted(source, scripted_options(ticks, workers), log, past)


def rewritten(
    log: Path,
    change: Callable[[Recorded], bytes],
    before: Callable[[Recorded], wire.Message | None] = lambda _: None,
) -> Path:
    """Return a recording with other payloads, and with more messages between them."""
    recording, path = Recording.open(log), log.with_name("rewritten.mcap")
    expected = dict(recording.noted().expected)
    with Writer(path) as writer:
        writer.start({k: v for k, v in recording.metadata.items() if k != "schema"})
        for one in recording.messages():
            if (more := before(one)) is not None:
                number = expected[more.sender]
                expected[more.sender] += 1
                said = wire.Delivery(more.key, number, one.sent, wire.encode(more))
                writer.add(said, one.log_time)
            delivery = one.delivery._replace(payload=change(one))
            writer.add(delivery, one.log_time)
        writer.finish({}, expected)
    return path


def observations(log: Path) -> list[wire.Observation]:
    found = (one.message for one in Recording.open(log).messages(("observation",)))
    return [message for message in found if isinstance(message, wire.Observation)]


# Unknown readings ---------------------------------------------------------------------


@pytest.mark.parametrize("workers", [0, 2])
def test_a_run_with_unknown_readings_is_derived_again(
    tmp_path: Path, workers: int
) -> None:
    source = Scripted(rows(unknown=True), ACTIONS)
    log = record(source, tmp_path / "log.mcap", workers)
    assert sum(bool(one.known) for one in observations(log)) > TICKS / 2
    verdict = verify(log)
    assert (verdict.difference, verdict.complete) == (None, True)
    assert verdict.states == TICKS


@pytest.mark.parametrize("sensor", [2, 3, 5])
def test_a_reading_said_to_be_unknown_that_is_known_is_found(
    tmp_path: Path, sensor: int
) -> None:
    """An own one shows in what is learned, a made one in what it is made of."""
    source = Scripted(rows(unknown=False), ACTIONS)
    log = record(source, tmp_path / "log.mcap")
    names = scripted_options(TICKS).sensors

    def change(one: Recorded) -> bytes:
        message = one.message
        if not isinstance(message, wire.Observation) or message.tick != 9:
            return one.payload
        mask = ((1 << len(names)) - 1) ^ (1 << sensor)
        size = len(message.bits)
        bits = int.from_bytes(message.bits, "little") & mask
        return wire.encode(
            msgspec.structs.replace(
                message,
                bits=bits.to_bytes(size, "little"),
                known=mask.to_bytes(size, "little"),
            )
        )

    difference = verify(rewritten(log, change)).difference
    assert difference is not None
    assert difference.startswith("tick 9: /")
    if sensor >= 3:
        assert f"/observation: {names[sensor]} does not follow" in difference


@pytest.mark.parametrize("kind", [Scripted, Live])
def test_a_run_with_unknown_readings_goes_on(
    tmp_path: Path, kind: type[Scripted]
) -> None:
    def source() -> Scripted:
        made = kind(rows(unknown=True), ACTIONS)
        if isinstance(made, Live):
            made.let_go(2 * TICKS)
        return made

    log = record(source(), tmp_path / "log.mcap")
    _, past = find_resume_point(log)
    again = tmp_path / "again.mcap"
    record(source(), again, past=past, ticks=TICKS + 10)
    verdict = verify(again)
    assert (verdict.difference, verdict.complete) == (None, True)
    assert verdict.ticks == TICKS + 10
    begins = [one.tick for one in observations(again) if one.begins]
    assert begins == ([1, TICKS + 1] if kind is Live else [1])
    if kind is Scripted:
        whole = tmp_path / "whole.mcap"
        record(source(), whole, ticks=TICKS + 10)
        assert observations(whole) == observations(again)


def test_a_report_by_a_wiring_not_in_force_is_left_out_again(tmp_path: Path) -> None:
    source = Scripted(rows(unknown=False), ACTIONS)
    log = record(source, tmp_path / "log.mcap")

    def change(one: Recorded) -> bytes:
        message = one.message
        if (
            isinstance(message, wire.CellReport)
            and message.wave == 15
            and message.cell == 1
        ):
            return wire.encode(msgspec.structs.replace(message, epoch=10**6))
        return one.payload

    difference = verify(rewritten(log, change)).difference
    assert difference is not None
    assert "derived nothing" in difference


def test_what_was_refused_of_a_wave_that_settled_is_refused_again(
    tmp_path: Path,
) -> None:
    source = Scripted(rows(unknown=False), ACTIONS)
    log = record(source, tmp_path / "log.mcap")

    def before(one: Recorded) -> wire.Message | None:
        message = one.message
        if not isinstance(message, wire.CellReport) or message.cell != 1:
            return None
        both = {"literals": (2, 3), "hops": (0, 0), "epoch": 10**6}
        return msgspec.structs.replace(message, **both)

    verdict = verify(rewritten(log, lambda one: one.payload, before=before))
    assert (verdict.difference, verdict.complete) == (None, True)
    assert verdict.states == TICKS
