"""Copies the start of a recording into a resumed run, or salvages intact parts.

A salvaged recording is whole as a file. Where the old one lacks messages it has a note
between its chunks, so that a reader derives nothing across, and says what is missing.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.recording.format.completeness import Completeness, RunningNumbers
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.recording_file import RecordingFile
from neurosnap.recording.read.stretches import lost_behind, pieces
from neurosnap.recording.write.writer import Writer

SALVAGED = "salvaged"
"""Among what is written of a run: the recording it was salvaged from."""
_OF_ITS_FILE = ("part", "begins", "split", "keep")
_BALANCE = ("completeness", "expected")


def take_over(writer: Writer, past: ResumePoint) -> None:
    """Begin a recording that was started with what a resumed run takes over."""
    old = RecordingFile.open(Path(past.log))
    _begin_shares(writer, old.share or {}, past.part)
    _copy_into(
        writer, old, lambda one: one.sequence < first_number(past, one.message.sender)
    )


def _copy_into(
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
                writer.write_gap(lost)
                lost = ""
            writer.add(recorded.delivery, recorded.log_time, recorded.message)


class Salvaged(msgspec.Struct, frozen=True):
    """The result of a salvage: what was written, and what was lost."""

    path: str
    completeness: Completeness
    """Of the new recording."""
    lost: tuple[str, ...]
    """What of the old one cannot be read, a line each; empty: it is whole."""


def salvage(log: Path, out: Path) -> Salvaged:
    """Write what can be proved of a recording into a new file.

    Every message of every chunk whose checksum is right is in it, and nothing else. Of
    a run in several files it is all of them in one. Time: that of reading twice and
    writing once.

    Args:
        log: A recording, or the first of its files for all of them.
        out: Must not exist yet; taken away again where it cannot be written.

    Raises:
        RecordingError: `log` is no recording of ours, or `out` cannot be written.
    """
    recording = Recording.open(log)
    with Writer(out) as writer:
        try:
            writer.start(_facts(recording))
            first = recording.files[0]
            if first.share is None:
                writer.sequences = RunningNumbers(anywhere=True)
            else:
                _begin_shares(writer, first.share, first.part)
            lost = _copy(writer, recording.files)
            lost = "; ".join((lost, *recording.unread)).strip("; ")
            if lost:
                writer.write_gap(lost)
            noted = recording.noted()
            totals = recording.totals or {}
            kept = {k: v for k, v in totals.items() if k not in _BALANCE}
            completeness = writer.finish(kept, noted.expected)
        except BaseException:
            writer.abandon()  # which would bring back what was deleted before
            out.unlink(missing_ok=True)
            raise
    return Salvaged(str(out), completeness, recording.lost)


def _begin_shares(writer: Writer, share: Mapping[str, int], part: int | None) -> None:
    """Let the senders' shares begin as in the first file there is."""
    for sender, number in share.items():
        writer.sequences.begin(sender, number)
    if part:
        writer.write_share()


def _copy(writer: Writer, files: Sequence[RecordingFile]) -> str:
    """Write the messages of all files; return why some are missing behind the last."""
    lost = ""
    for file, after in zip_longest(files, files[1:]):
        _copy_into(writer, file, lost=lost)
        lost = lost_behind(file, after)
    return lost


def _facts(recording: Recording) -> dict[str, str]:
    """Return what is written of the run."""
    facts = dict(recording.metadata)
    first = recording.files[0]
    for name in _OF_ITS_FILE:  # where the new file begins is where the first does
        facts.pop(name, None)
        if first.begins and name in first.metadata:
            facts[name] = first.metadata[name]
    facts[SALVAGED] = recording.path.name
    return facts
