"""What a resumed run has behind it, and how its recording takes that over.

Apart from `neurosnap.recording.replay.resume`, which finds it out: the parts that only
carry it need none of the mathematics, and start the faster.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from neurosnap.recording.read.reader import Recorded, Recording
from neurosnap.recording.read.stretches import lost_before, pieces
from neurosnap.recording.write.writer import Writer


class Past(msgspec.Struct, frozen=True):
    """What a run that is resumed has behind it; small, and sent to every part."""

    log: str
    """The recording it goes on from; of several files the last."""
    tick: int
    """The last whole tick."""
    actions: tuple[int, ...]
    """The actions between its first observation and its last."""
    state: bytes
    """The state after the last whole tick, packed."""
    counts: dict[str, int]
    """For each part, how many of its messages are kept; its next one's number."""
    resumed: tuple[int, ...]
    """The ticks after which it was resumed, this time included."""
    part: int = 0
    """Which of the files of the run the recording is, from 0."""
    begins: int = 0
    """The tick of the key-frame that file begins with; 0: it begins with the run."""


def first_number(past: Past | None, who: str) -> int:
    """Return the number of the first message of a part."""
    return 0 if past is None else past.counts.get(who, 0)


def facts_of(metadata: Mapping[str, str], past: Past | None) -> dict[str, str]:
    """Return what is written of a run, where it is resumed with that it is."""
    if past is None:
        return dict(metadata)
    resumed = msgspec.json.encode(past.resumed).decode()
    return {**metadata, "resumed": resumed}


def begin_recording(
    writer: Writer, metadata: Mapping[str, str], past: Past | None
) -> None:
    """Start a recording: with what is taken over, where a run is resumed."""
    writer.start(facts_of(metadata, past))
    if past is None:
        return
    old = Recording.open(Path(past.log))
    for sender, first in (old.share or {}).items():
        writer.sequences.begin(sender, first)
    if past.part:
        writer.note_share()
    copy_into(
        writer, old, lambda one: one.sequence < first_number(past, one.message.sender)
    )


def copy_into(
    writer: Writer,
    old: Recording,
    keeps: Callable[[Recorded], bool] = lambda _: True,
    lost: str = "",
) -> None:
    """Write the messages of a file, and note where some are missing before.

    Args:
        writer: Started.
        old: The file.
        keeps: Which of its messages to take.
        lost: Why some are missing before the first; empty: none are.
    """
    for piece in pieces(old):
        lost = lost or lost_before(piece)
        for recorded in filter(keeps, piece.messages()):
            if lost:
                writer.note_gap(lost)
                lost = ""
            writer.put(recorded.message, recorded.delivery, recorded.log_time)
