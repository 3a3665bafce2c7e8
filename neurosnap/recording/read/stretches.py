"""Stretches of a recording that can be derived without gaps.

A recording that lacks nothing is one stretch. Where messages are missing, as
after damage, a stretch ends; the next begins with the following key-frame, which holds
all that is needed to start there.
"""

from collections.abc import Iterator
from itertools import dropwhile, pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec

from neurosnap import wire
from neurosnap.recording.format.records import TOTALS, Cut, Layout
from neurosnap.recording.read.keyframes import starts
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.read.split_files import Whole


class Piece(Recording):
    """Some chunks of a file, one behind the other.

    Args:
        path: The file.
        layout: What lies where in it, without the other chunks.
        begins: The tick of the key-frame to begin with; 0: with the run.
        lost: Why messages are missing before it; empty: none are.
    """

    def __init__(self, path: Path, layout: Layout, begins: int, lost: str) -> None:
        super().__init__(path, layout)
        self._begins = begins
        self.lost = lost

    @property
    def begins(self) -> int:
        """The tick of the key-frame that it begins with; 0: it begins with the run."""
        return self._begins

    @property
    def share(self) -> dict[str, int] | None:
        """The number each sender's share begins with; None where that is not known."""
        return None if self.lost else super().share

    @property
    def whole(self) -> bool:
        """Always false: it is a piece."""
        return False


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
    if not isinstance(recording, Whole):
        return _begun([[piece] for piece in pieces(recording)])
    rows: list[list[Recording]] = []
    before: Recording | None = None
    for part in recording.parts:
        some = pieces(part)
        follows = before is not None and not lost_behind(before, part)
        if follows and rows and some and not lost_before(some[0]):
            rows[-1].append(some.pop(0))
        rows += [[piece] for piece in some]
        before = part
    if len(rows) == 1 and rows[0] == list(recording.parts):
        return [recording]
    return _begun(rows)


def _begun(rows: list[list[Recording]]) -> list[Recording]:
    """Return each row without the pieces before its first usable key-frame."""
    found: list[Recording] = []
    for row in rows:
        begun = list(dropwhile(lambda piece: piece.begins < 0, row))
        if begun:
            found.append(begun[0] if len(begun) == 1 else Whole(begun))
    return found


def lost_before(piece: Recording) -> str:
    """Return why messages are missing before a piece; empty: none are."""
    return piece.lost if isinstance(piece, Piece) else ""


def lost_behind(part: Recording, after: Recording | None) -> str:
    """Return why messages are missing behind a file; empty: none are.

    Args:
        part: The file.
        after: The next there is of its run; None: there is none.
    """
    layout = part.layout
    last = layout.chunks[-1].offset if layout.chunks else 0
    behind = [one.why for one in _breaks(layout) if one.offset > last]
    if (cut := part.cut) is not None:
        behind.append(f"cut short at byte {cut.offset} of {cut.size}")
    if after is not None and after.part != (part.part or 0) + 1:
        behind.append("the next file is missing")
    return behind[0] if behind else ""


def pieces(recording: Recording) -> list[Recording]:
    """Return a file in pieces, between which messages are missing.

    All together hold all of its messages. Behind a break a piece begins with its first
    key-frame; where there is none, `begins` is -1.
    """
    breaks = _real(recording, _breaks(recording.layout))
    if not breaks:
        return [recording]
    found = []
    for before, (start, stop) in _ranges(recording, breaks):
        if before is None:
            piece = _piece(recording, start, stop, recording.begins)
        else:
            piece = _piece(recording, start, stop, 0, before.why)
            begins = next((one.frame.tick for one in starts(piece)), -1)
            piece = Piece(piece.path, piece.layout, begins, before.why)
        if piece.layout.chunks:
            found.append(piece)
    return list(found)


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
    recording: Recording, breaks: list[_Break]
) -> Iterator[tuple[_Break | None, tuple[int, int]]]:
    """Yield the bytes between breaks, from first to last, each behind its break."""
    edges = (0, *(one.offset for one in breaks), recording.layout.size + 1)
    return zip((None, *breaks), pairwise(edges), strict=True)


def _piece(
    recording: Recording, start: int, stop: int, begins: int, lost: str = ""
) -> Piece:
    """Return what is in a file from byte `start` to byte `stop`."""
    whole = recording.layout
    chunks = [chunk for chunk in whole.chunks if start <= chunk.offset < stop]
    layout = msgspec.structs.replace(whole, chunks=chunks, damage=[], gaps=[])
    if stop <= whole.size:
        layout.cut = Cut(len(chunks), stop, whole.size)
        layout.metadata = {k: v for k, v in whole.metadata.items() if k != TOTALS}
    return Piece(recording.path, layout, begins, lost)


def _real(recording: Recording, breaks: list[_Break]) -> list[_Break]:
    """Return the breaks at which messages are missing.

    Where a break is uncertain, the senders' sequence numbers decide: damage that hit no
    messages is no break.
    """
    if all(one.certain for one in breaks):
        return breaks
    upcoming = dict(recording.share or {})
    real: list[_Break] = []
    for before, (start, stop) in _ranges(recording, breaks):
        heard: set[str] = set()
        jumps = False
        for recorded in _piece(recording, start, stop, 0).messages():
            who, number = recorded.message.sender, recorded.sequence
            jumps = jumps or (who not in heard and number > upcoming.get(who, 0))
            heard.add(who)
            upcoming[who] = max(number + 1, upcoming.get(who, 0))
        if before is not None and (before.certain or jumps):
            real.append(before)
    return real


def last_tick(recording: Recording) -> int:
    """Return the last tick whose state was recorded, 0 if there is none."""
    tick = 0
    for recorded in recording.messages(("state",)):
        if isinstance(recorded.message, wire.State):
            tick = max(tick, recorded.message.tick)
    return tick
