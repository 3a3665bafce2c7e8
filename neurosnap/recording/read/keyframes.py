"""Key-frames of a recording: the places where a replay can start.

What a key-frame says is all there is to know, so nothing before it has to be read. Of
what was sent after it, something may have overtaken it on the way to the recorder.
"""

from collections.abc import Iterator
from typing import NamedTuple

from neurosnap import wire
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording

EARLY = 2 * 10**9
"""Nanoseconds by which a message may overtake, or be behind, another one's; what takes
the longest way passes two queues on one host, or on two."""


class Start(NamedTuple):
    """A key-frame one can start from."""

    frame: wire.KeyFrame
    sequence: int
    """Its running number among the coordinator's."""
    log_time: int
    """When it was recorded, nanoseconds since the epoch."""
    bands: tuple[wire.Band, ...] = ()
    """What belongs to it."""

    @property
    def since(self) -> int:
        """The time of recording before which there is nothing from after it."""
        return max(0, self.log_time - EARLY)


class Gathering:
    """Puts key-frames together with their bands.

    Of one that lacks a band nothing can be made. Only the last one is in hand.
    """

    def __init__(self) -> None:
        self._start: Start | None = None
        self._bands: dict[tuple[str, int], wire.Band] = {}

    def add(self, recorded: Recorded) -> Start | None:
        """Add a message; return the key-frame that is whole with it, if one is."""
        match recorded.message:
            case wire.KeyFrame() as frame:
                self._start = Start(frame, recorded.sequence, recorded.log_time)
                self._bands = {}
            case wire.Band() as band if self._start is not None:
                if band.tick != self._start.frame.tick:
                    return None
                self._bands[band.array, band.offset] = band
            case _:
                return None
        start = self._start
        if len(self._bands) < start.frame.bands:
            return None
        self._start = None
        return start._replace(bands=(*self._bands.values(),))


def starts(recording: Recording) -> Iterator[Start]:
    """Yield the key-frames of a recording that are whole, in order.

    Of a finished recording only chunks that hold one are unpacked.

    Raises:
        RecordingError: While iterating: it is damaged.
    """
    gathering = Gathering()
    for recorded in recording.messages(("keyframe", "band")):
        start = gathering.add(recorded)
        if start is not None:
            yield start


def last_start(recording: Recording, tick: int) -> Start | None:
    """Return the last of them that is not after `tick`.

    Raises:
        RecordingError: The recording is damaged.
    """
    last = None
    for start in starts(recording):
        if start.frame.tick <= tick:
            last = start
    return last
