"""Verifies a recording: replays each stretch of it, and reports the result."""

import time
from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

import msgspec

from neurosnap.errors import RecordingError
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.replay_starts import starts
from neurosnap.recording.read.stretches import stretches
from neurosnap.recording.replay.compare_derived import DifferenceError, Replay, start_of


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """The result of verifying a recording."""

    files: int
    """How many files it is recorded in."""

    same: bool
    """Everything derived equals what was recorded."""
    complete: bool
    """The recording was finished, is not damaged, and lacks no message."""
    difference: str | None
    """The first difference: where, what was recorded, what was derived."""
    start: int
    """The tick of the key-frame it began with, 0: it began with the run."""
    ticks: int
    """Whole ticks that were compared."""
    wirings: int
    """Wirings that were compared, and so on."""
    waves: int
    states: int
    decisions: int
    seconds: float
    """What it took."""
    ranges: tuple[tuple[int, int], ...] = ()
    """The first and the last tick of each stretch that was compared."""
    missing: tuple[tuple[int, int], ...] = ()
    """The first and the last of the ticks in between that cannot be derived."""
    damage: tuple[str, ...] = ()
    """What cannot be read; see `Recording.damage`."""


def verify(path: Path, tick: int = 0) -> Verdict:
    """Replay a recording and compare.

    Memory is bounded by what arrived out of order. Time: a small fraction of the run's.

    Args:
        path: A recording, or the first of its files for all of them. A later file is
            verified alone, from the key-frame that it begins with.
        tick: Begin with the last key-frame that is not after it; 0: with the first
            message there is.

    Raises:
        RecordingError: It cannot be read, or no key-frame is there to begin with.
    """
    began = time.perf_counter()
    recording = Recording.open(path)
    count: Counter[str] = Counter()
    ranges: list[tuple[int, int]] = []
    difference, first = None, 0
    for replay in _replays(recording, tick):
        try:
            for _ in replay.ticks():
                pass
        except DifferenceError as error:
            difference = str(error)
        count.update(replay.compared)
        if not ranges:
            first = replay.first
        if replay.core.tick > replay.first:
            ranges.append((replay.first + 1, replay.core.tick))
        if difference is not None:
            break
    return Verdict(
        files=len(recording.files),
        same=difference is None,
        complete=recording.whole,
        difference=difference,
        start=first,
        ticks=sum(last - first + 1 for first, last in ranges),
        wirings=count["wiring"] + count["workerwiring"],
        waves=count["wavestart"],
        states=count["state"],
        decisions=count["decision"],
        seconds=time.perf_counter() - began,
        ranges=tuple(ranges),
        missing=tuple(_between(recording, first, ranges)),
        damage=recording.damage,
    )


def _replays(recording: Recording, tick: int) -> Iterator[Replay]:
    """Yield replays, each to be iterated over before the next, of all there is.

    Where one can derive no more, the next begins with the key-frame behind.
    """
    several = stretches(recording)
    if not several:
        rule = "must hold a key-frame behind what is missing"
        raise RecordingError(f"{recording.path}: {rule}, got none")
    for stretch, after in zip_longest(several, several[1:]):
        if after is not None and after.begins <= tick:
            continue
        start = start_of(stretch, tick)
        while True:
            replay = Replay(stretch, start)
            yield replay
            reached = replay.core.tick
            behind = (s for s in starts(stretch) if s.frame.tick > reached)
            if replay.complete or (start := next(behind, None)) is None:
                break


def _between(
    recording: Recording, first: int, ranges: list[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Yield the ticks that are missing, those behind the last range included."""
    reached = first
    if not first and recording.begins:
        reached = recording.begins
    for start, stop in ranges:
        if start > reached + 1:
            yield reached + 1, start - 1
        reached = stop
    if recording.damage and (last := TickIndex(recording).last_tick()) > reached:
        yield reached + 1, last
