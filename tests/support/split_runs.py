"""A run of three sensors, and how it comes into several files."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.write.rotation import Split, SplitWriter
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.scripted_sources import Scripted

TICKS = 60
EVERY = 10
SMALL = Split(1)
"""Every key-frame begins another file."""


def options(workers: int = 0, ticks: int = TICKS) -> RunOptions:
    return scripted_options(ticks, workers, keyframe_every=EVERY)


def made(
    log: Path, workers: int = 0, past: ResumePoint | None = None, ticks: int = TICKS
) -> Path:
    """Record a run in one process."""
    source = Scripted(implying_rows(2 * TICKS, 3, unknown=0.1), ACTIONS)
    return record_scripted(source, options(workers, ticks), log, past)


def write(
    whole: Path,
    log: Path,
    recorded: Iterable[Recorded],
    step: int = 1,
    split: Split = SMALL,
) -> dict[int, Path]:
    """Record messages again, `step` nanoseconds apart, as if they came now."""
    old = Recording.open(whole)
    with SplitWriter(log, old.metadata, split=split) as writer:
        for count, one in enumerate(recorded):
            now = 10**18 + count * step
            writer.add(one.delivery, now)
            if count % 8 == 0:  # a chunk each would be many to read
                writer.flush(now)
        writer.finish({}, old.noted().expected)
    return part_paths(log)


def content(recorded: Iterable[Recorded]) -> list[tuple[str, int, bytes]]:
    return sorted((m.message.sender, m.sequence, m.payload) for m in recorded)


# Given to the disk --------------------------------------------------------------------


def upto(recorded: Sequence[Recorded], tick: int) -> list[Recorded]:
    """Return what was recorded before the key-frame of a tick."""
    place = next(
        place
        for place, one in enumerate(recorded)
        if isinstance(one.message, wire.KeyFrame) and one.message.tick == tick
    )
    return list(recorded[:place])


# What is late, lost, or comes again ---------------------------------------------------


def last_of(recorded: Sequence[Recorded], tick: int) -> int:
    """Return the place of the last report on the waves up to a tick."""
    frame = next(
        one.message
        for one in recorded
        if isinstance(one.message, wire.KeyFrame) and one.message.tick == tick
    )
    return max(
        place
        for place, one in enumerate(recorded)
        if isinstance(one.message, wire.CellReport | wire.WorkerReport)
        and one.message.wave <= frame.waves
    )


def silenced(recorded: Iterable[Recorded], lost: Recorded) -> list[Recorded]:
    """Return what was recorded without a message and all its sender says later."""
    return [
        one
        for one in recorded
        if one.message.sender != lost.message.sender or one.sequence < lost.sequence
    ]


NOW = 10**18


def said(*messages: wire.Message) -> list[wire.Delivery]:
    return [
        wire.Delivery(message.key, number, NOW, wire.encode(message))
        for number, message in enumerate(messages)
    ]


# Going on -----------------------------------------------------------------------------


def options_workers(log: Path) -> int:
    recorded = msgspec.json.decode(Recording.open(log).metadata["options"])
    return int(recorded["workers"]) if recorded["cells"] == "worker" else 0
