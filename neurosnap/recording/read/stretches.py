"""Finds the stretches of a recording that can be replayed without gaps.

A recording that lacks nothing is one stretch. Where messages are missing, as
after damage, a stretch ends; the next begins with the following key-frame, which holds
all that is needed to start there.
"""

from collections.abc import Iterator
from itertools import dropwhile, pairwise
from typing import NamedTuple

import msgspec

from neurosnap.recording.format.records import TOTALS, Cut, Layout
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.recording_file import RecordingFile
from neurosnap.recording.read.replay_starts import starts


class _Break(NamedTuple):
    """A place in a file where messages may be missing."""

    offset: int
    certain: bool
    why: str


def stretches(recording: Recording) -> list[Recording]:
    """Return the stretches of a recording, in order.

    One that has no key-frame to begin with is left out. Time: none where nothing is
    missing; else that of reading the key-frames, or, where it is not certain that
    messages are missing, of reading all.

    Raises:
        RecordingError: While messages are read.
    """
    rows: list[list[RecordingFile]] = []
    before: RecordingFile | None = None
    for file in recording.files:
        some = pieces(file)
        follows = before is not None and not lost_behind(before, file)
        if before is not None and not follows and some and some[0].begins > 0:
            some[0] = _rebegun(some[0])
        if follows and rows and some and not some[0].lost:
            rows[-1].append(some.pop(0))
        rows += [[piece] for piece in some]
        before = file
    if rows == [[*recording.files]]:
        return [recording]
    # Each row without the pieces before its first usable key-frame.
    begun = (list(dropwhile(lambda piece: piece.begins < 0, row)) for row in rows)
    return [Recording(row) for row in begun if row]


def lost_behind(part: RecordingFile, after: RecordingFile | None) -> str:
    """Return why messages are missing behind a file; empty: none are.

    Args:
        part: The file.
        after: The next there is of its run; None if there is none.
    """
    layout = part.layout
    last = layout.chunks[-1].offset if layout.chunks else 0
    behind = [one.why for one in _breaks(layout) if one.offset > last]
    if (cut := part.cut) is not None:
        behind.append(f"cut short at byte {cut.offset} of {cut.size}")
    if after is not None and after.part != (part.part or 0) + 1:
        behind.append("the next file is missing")
    return behind[0] if behind else ""


def pieces(file: RecordingFile) -> list[RecordingFile]:
    """Return a file in pieces, between which messages are missing.

    All together hold all of its messages. Behind a break a piece begins with its first
    key-frame; where there is none, `begins` is -1.
    """
    breaks = _real(file, _breaks(file.layout))
    if not breaks:
        return [file]
    found = []
    for before, (start, stop) in _ranges(file, breaks):
        if before is None:
            piece = _piece(file, start, stop, file.begins)
        else:
            begins = next(
                (
                    one.frame.tick
                    for one in starts(Recording([_piece(file, start, stop, 0)]))
                ),
                -1,
            )
            piece = _piece(file, start, stop, begins, before.why)
        if piece.layout.chunks:
            found.append(piece)
    return found


def _rebegun(piece: RecordingFile) -> RecordingFile:
    """Return a piece that begins with its first key-frame that is whole."""
    tick = next((one.frame.tick for one in starts(Recording([piece]))), -1)
    if tick == piece.begins:
        return piece
    return _piece(piece, 0, piece.layout.size + 1, tick)


def _breaks(layout: Layout) -> list[_Break]:
    """Return where messages are missing, or may be."""
    damage = (one for one in layout.damage if one.lost != "nothing")
    return sorted(
        (
            *(
                _Break(
                    one.start,
                    one.lost == "chunk",
                    f"bytes {one.start} to {one.stop} of another file: {one.why}",
                )
                for one in damage
            ),
            *(_Break(gap.offset, True, gap.why) for gap in layout.gaps),
        )
    )


def _ranges(
    file: RecordingFile, breaks: list[_Break]
) -> Iterator[tuple[_Break | None, tuple[int, int]]]:
    """Yield the bytes between breaks, from first to last, each behind its break."""
    edges = (0, *(one.offset for one in breaks), file.layout.size + 1)
    return zip((None, *breaks), pairwise(edges), strict=True)


def _piece(
    file: RecordingFile, start: int, stop: int, begins: int, lost: str = ""
) -> RecordingFile:
    """Return what is in a file from byte `start` to byte `stop`."""
    whole = file.layout
    chunks = [chunk for chunk in whole.chunks if start <= chunk.offset < stop]
    layout = msgspec.structs.replace(whole, chunks=chunks, damage=[], gaps=[])
    if stop <= whole.size:
        layout.cut = Cut(len(chunks), stop, whole.size)
        layout.metadata = {k: v for k, v in whole.metadata.items() if k != TOTALS}
    return RecordingFile(file.path, layout, begins=begins, lost=lost)


def _real(file: RecordingFile, breaks: list[_Break]) -> list[_Break]:
    """Return the breaks at which messages are missing.

    Where a break is uncertain, the senders' sequence numbers decide: damage that hit no
    messages is no break.
    """
    if all(one.certain for one in breaks):
        return breaks
    upcoming = dict(file.share or {})
    real: list[_Break] = []
    for before, (start, stop) in _ranges(file, breaks):
        heard: set[str] = set()
        jumps = False
        for recorded in _piece(file, start, stop, 0).messages():
            who, number = recorded.message.sender, recorded.sequence
            jumps = jumps or (who not in heard and number > upcoming.get(who, 0))
            heard.add(who)
            upcoming[who] = max(number + 1, upcoming.get(who, 0))
        if before is not None and (before.certain or jumps):
            real.append(before)
    return real
