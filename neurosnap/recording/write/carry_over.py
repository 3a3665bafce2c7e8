"""Copies the beginning of a recording into that of the resumed run."""

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.file import RecordingFile
from neurosnap.recording.read.stretches import pieces
from neurosnap.recording.write.writer import Writer


def facts_of(metadata: Mapping[str, str], past: ResumePoint | None) -> dict[str, str]:
    """Return what is written of a run, where it is resumed with that it is."""
    if past is None:
        return dict(metadata)
    resumed = msgspec.json.encode(past.resumed).decode()
    return {**metadata, "resumed": resumed}


def begin_recording(
    writer: Writer, metadata: Mapping[str, str], past: ResumePoint | None
) -> None:
    """Start a recording: with what is taken over, where a run is resumed."""
    writer.start(facts_of(metadata, past))
    if past is None:
        return
    old = RecordingFile.open(Path(past.log))
    for sender, first in (old.share or {}).items():
        writer.sequences.begin(sender, first)
    if past.part:
        writer.note_share()
    copy_into(
        writer, old, lambda one: one.sequence < first_number(past, one.message.sender)
    )


def copy_into(
    writer: Writer,
    old: RecordingFile,
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
        lost = lost or piece.lost
        for recorded in filter(keeps, piece.messages()):
            if lost:
                writer.note_gap(lost)
                lost = ""
            writer.put(recorded.message, recorded.delivery, recorded.log_time)
