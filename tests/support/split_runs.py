"""A run of three sensors, recorded in several files."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

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
from tests.support.recorded_messages import first
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


class SplitRun(NamedTuple):
    """A run, and where it is recorded again in several files."""

    whole: Path
    """Its recording in one file."""
    messages: Sequence[Recorded]
    """All of it."""
    log: Path

    def write(
        self,
        recorded: Iterable[Recorded] | None = None,
        log: Path | None = None,
        split: Split = SMALL,
    ) -> dict[int, Path]:
        """Record messages again as if they came now: all, if none are given."""
        old, log = Recording.open(self.whole), log or self.log
        with SplitWriter(log, old.metadata, split=split) as writer:
            for count, one in enumerate(
                self.messages if recorded is None else recorded
            ):
                now = 10**18 + count
                writer.add(one.delivery, now)
                if count % 8 == 0:  # a chunk each would be many to read
                    writer.flush(now)
            writer.finish({}, old.noted().expected)
        return part_paths(log)

    def frame(self, tick: int) -> tuple[int, wire.KeyFrame]:
        """Return the key-frame of a tick, and its place."""
        return first(self.messages, wire.KeyFrame, lambda frame: frame.tick == tick)

    def upto(self, tick: int) -> list[Recorded]:
        """Return what was recorded before the key-frame of a tick."""
        return list(self.messages[: self.frame(tick)[0]])

    def last_of(self, tick: int) -> int:
        """Return the place of the last report on the waves up to a tick."""
        _, frame = self.frame(tick)
        return max(
            place
            for place, one in enumerate(self.messages)
            if isinstance(one.message, wire.CellReport | wire.WorkerReport)
            and one.message.wave <= frame.waves
        )

    @property
    def workers(self) -> int:
        """How many workers it has, in place of cells."""
        recorded = msgspec.json.decode(Recording.open(self.whole).metadata["options"])
        return int(recorded["workers"]) if recorded["cells"] == "worker" else 0


def content(recorded: Iterable[Recorded]) -> list[tuple[str, int, bytes]]:
    return sorted((m.message.sender, m.sequence, m.payload) for m in recorded)


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
