"""Random access to the messages of a recording by tick.

The ticks of a recording grow from chunk to chunk. So the chunk with a tick is found by
halving, and nothing in between is unpacked. What was unpacked is kept for a while: who
looks at one tick mostly looks at the next.
"""

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.protocol.key_frames import whole
from neurosnap.recording.read.chunk_messages import ChunkMessages, M
from neurosnap.recording.read.recording import Recording

ROOM = 24 * 2**20
"""Bytes of unpacked chunks that are kept, at most, with what was decoded of them; the
last one in any case."""
_OBSERVATIONS = 100_000
"""Observations that are kept beyond that."""


class Lessons(NamedTuple):
    """The messages of a chunk that change what is learned."""

    observations: list[wire.Observation]
    changes: list[wire.Decision]
    """Decisions that say which sensor comes or goes."""


class LessonCache:
    """A cache of what recently read chunks teach. Threads may share it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._kept: OrderedDict[tuple[Path, int], Lessons] = OrderedDict()
        self._observations = 0

    def find(self, chunk: tuple[Path, int]) -> Lessons | None:
        """Return the lessons of a chunk, by its file and offset there, if kept."""
        with self._lock:
            if chunk in self._kept:
                self._kept.move_to_end(chunk)
            return self._kept.get(chunk)

    def keep(self, chunk: tuple[Path, int], lessons: Lessons) -> None:
        """Keep the lessons of a chunk, and forget those asked for longest ago."""
        with self._lock:
            if chunk not in self._kept:
                self._observations += len(lessons.observations)
            self._kept[chunk] = lessons
            while self._observations > _OBSERVATIONS and len(self._kept) > 1:
                _, forgotten = self._kept.popitem(last=False)
                self._observations -= len(forgotten.observations)


class TickIndex:
    """A recording's chunks, by tick. To be used by one thread at a time.

    Args:
        recording: It may grow.
        lessons: Those of another index of the same recording, to be shared; None: its
            own.
    """

    def __init__(
        self, recording: Recording, lessons: LessonCache | None = None
    ) -> None:
        self.lessons = lessons or LessonCache()
        self.damage: dict[int, str] = {}
        """For each chunk that cannot be read, why."""
        self.recording = recording
        self._first_ticks: dict[int, int] = {}
        self._kept: OrderedDict[int, ChunkMessages] = OrderedDict()

    def __len__(self) -> int:
        """Return the number of chunks."""
        return len(self.recording.chunks)

    def grow(self) -> bool:
        """Look at what the files have gained; return whether that is anything.

        Raises:
            RecordingError: A file cannot be read.
        """
        grown, moved = self.recording.grow()
        if moved:
            for kept in (self._first_ticks, self._kept, self.damage):
                kept.clear()
        elif grown:
            # What was behind the last tick may be in front of a next one now.
            self._first_ticks = {k: v for k, v in self._first_ticks.items() if v}
        return grown

    def chunk(self, number: int) -> ChunkMessages:
        """Return the chunk of a number, counted from 0.

        Raises:
            RecordingError: It is damaged.
        """
        if number in self._kept:
            self._kept.move_to_end(number)
            return self._kept[number]
        try:
            file, noted = self.recording.chunks[number]
            chunk = file.chunk(noted)
        except RecordingError as error:
            self.damage.setdefault(number, str(error))
            raise
        self._kept[number] = chunk
        size = sum(kept.size for kept in self._kept.values())
        while size > ROOM and len(self._kept) > 1:
            size -= self._kept.popitem(last=False)[1].size
        return chunk

    def readable(self, start: int, stop: int) -> Iterator[tuple[int, ChunkMessages]]:
        """Yield the chunks from `start` up to `stop` that can be read."""
        for number in range(max(0, start), min(stop, len(self))):
            try:
                yield number, self.chunk(number)
            except RecordingError:  # noted in `damage`
                continue

    def _said(self, number: int, topic: str, kind: type[M]) -> list[M]:
        """Return a chunk's messages of a topic; none if it cannot be read."""
        for _, chunk in self.readable(number, number + 1):
            return chunk.all(topic, kind)
        return []

    def observed(self, number: int) -> list[wire.Observation]:
        """Return the observations in a chunk; none if it cannot be read."""
        return self._lessons(number).observations

    def _lessons(self, number: int) -> Lessons:
        """Return what learning takes of a chunk; nothing if it cannot be read."""
        file, noted = self.recording.chunks[number]
        key = file.path, noted.start_offset
        lessons = self.lessons.find(key)
        if lessons is None:
            said = self._said(number, "decision", wire.Decision)
            lessons = Lessons(
                self._said(number, "observation", wire.Observation),
                [each for each in said if max(each.born, each.retires) >= 0],
            )
            self.lessons.keep(key, lessons)
        return lessons

    def observations(self, first: int, last: int) -> Iterator[wire.Observation]:
        """Yield the observations there are of some ticks, in order, each once."""
        due = first
        for number in range(self.chunk_of(first), len(self)):
            for observation in self.observed(number):
                if due <= observation.tick <= last:
                    yield observation
                due = max(due, observation.tick + 1)
            if due > last:
                return

    def changes(self, first: int, last: int) -> dict[int, wire.Decision]:
        """Return the decisions of some ticks that say which sensor comes or goes.

        The chunks of their observations are unpacked, and the one behind: a decision
        follows its observation.
        """
        behind = min(self.chunk_of(last) + 2, len(self))
        return {
            decision.tick: decision
            for number in range(self.chunk_of(first), behind)
            for decision in self._lessons(number).changes
            if first <= decision.tick <= last
        }

    def chunk_of(self, tick: int) -> int:
        """Return the chunk in which a tick was observed, or would have been.

        O(log(chunks)) chunks are unpacked.
        """
        return max(0, bisect_right(range(len(self)), tick, key=self._first_tick) - 1)

    def chunk_after(self, tick: int) -> int:
        """Return the chunk in which the tick after one was observed; else the last."""
        for number in range(self.chunk_of(tick), len(self)):
            if any(seen.tick > tick for seen in self.observed(number)):
                return number
        return max(0, len(self) - 1)

    def last_tick(self) -> int:
        """Return the last tick whose state was recorded; 0: there is none."""
        for number in reversed(range(len(self))):
            if states := self._said(number, "state", wire.State):
                return max(state.tick for state in states)
        return 0

    def keyframe(self, tick: int) -> tuple[wire.KeyFrame, list[wire.Band]] | None:
        """Return the last key-frame at a tick or before, with its bands.

        Of one that lacks a band nothing can be made: the one before it is taken; None
        if there is none. Only chunks that are said to have one are unpacked.
        """
        for number in reversed(range(min(self.chunk_after(tick) + 2, len(self)))):
            found = sorted(self._keyframes(number), key=lambda frame: -frame.tick)
            for frame in found:
                if frame.tick <= tick and len(own := self._bands(frame)) >= frame.bands:
                    return whole(frame, own), own
        return None

    def _bands(self, frame: wire.KeyFrame) -> list[wire.Band]:
        """Return the bands of a key-frame that are there, each once.

        A run that ends where a key-frame was due says it twice.
        """
        found: dict[tuple[str, int], wire.Band] = {}
        number = max(0, self.chunk_of(frame.tick) - 1)
        stop = min(self.chunk_after(frame.tick + 1) + 2, len(self))
        while len(found) < frame.bands and number < stop:
            for band in self._said(number, "band", wire.Band):
                if band.tick == frame.tick:
                    found[band.array, band.offset] = band
            number += 1
        return [*found.values()]

    def keyframe_after(self, tick: int) -> int:
        """Return the tick of the first key-frame after one; very large: none."""
        for number in range(max(0, self.chunk_of(tick) - 1), len(self)):
            after = [f.tick for f in self._keyframes(number) if f.tick > tick]
            if after:
                return min(after)
        return 1 << 62

    def _keyframes(self, number: int) -> list[wire.KeyFrame]:
        """Return the key-frames in a chunk that is said to have any.

        The last chunk of a recording that was cut short may lack what says so.
        """
        file, chunk = self.recording.chunks[number]
        topics = {file.topics.get(channel) for channel in chunk.counts}
        if topics and "keyframe" not in topics:
            return []
        return self._said(number, "keyframe", wire.KeyFrame)

    def _first_tick(self, number: int) -> int:
        """Return the first tick observed in a chunk or after it; very large: none."""
        passed = []
        found = 0
        while number < len(self):
            if number in self._first_ticks:
                found = self._first_ticks[number]
                break
            passed.append(number)
            found = min((seen.tick for seen in self.observed(number)), default=0)
            if found:
                break
            number += 1
        for before in passed:
            self._first_ticks[before] = found
        return found or 1 << 62
