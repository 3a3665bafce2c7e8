"""The places where a replay can start: the whole key-frames of a recording.

What a key-frame says is all there is to know, so nothing before it has to be read. Of
what was sent after it, something may have overtaken it on the way to the recorder.
"""

from collections.abc import Iterator
from typing import NamedTuple

from neurosnap import wire
from neurosnap.protocol.key_frames import whole
from neurosnap.recording.read.recording import Recording

EARLY = 2 * 10**9
"""Nanoseconds by which a message may overtake, or be behind, another one's; what takes
the longest way passes two queues on one host, or on two."""


class Start(NamedTuple):
    """A key-frame from which a replay can start."""

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


def starts(recording: Recording) -> Iterator[Start]:
    """Yield the key-frames of a recording that are whole, in order.

    Of one that lacks a band nothing can be made. Only the last one is in hand. Of a
    finished recording only chunks that hold one are unpacked.

    Raises:
        RecordingError: While iterating: it is damaged.
    """
    start: Start | None = None
    bands: dict[tuple[str, int], wire.Band] = {}
    for recorded in recording.messages(("keyframe", "band")):
        match recorded.message:
            case wire.KeyFrame() as frame:
                start = Start(frame, recorded.sequence, recorded.log_time)
                bands = {}
            case wire.Band() as band if (
                start is not None and band.tick == start.frame.tick
            ):
                bands[band.array, band.offset] = band
            case _:
                continue
        if len(bands) >= start.frame.bands:
            every = bands.values()
            yield start._replace(frame=whole(start.frame, every), bands=(*every,))
            start = None


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
