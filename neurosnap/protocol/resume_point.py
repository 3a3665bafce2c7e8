"""The point where a resumed run goes on: the state after its last whole tick.

`neurosnap.recording.replay.find_resume_point` finds it; the parts only carry it.
"""

import zlib
from typing import TYPE_CHECKING

import msgspec

from neurosnap import wire
from neurosnap.agent.growth_in_decisions import Context

if TYPE_CHECKING:
    from neurosnap.agent.body import Body


class ResumePoint(msgspec.Struct, frozen=True):
    """The state of a run that is resumed, small enough to be sent to every part."""

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
    grown: tuple[Context, ...] = ()
    """The contexts of the sensors that were grown before that tick's decision."""
    retired: tuple[int, ...] = ()
    """The places among them of those that are read no more."""
    received: wire.Received | None = None
    """What a live source had received up to that tick."""
    seen: tuple[int, int] = (0, 0)
    """A tick, and a checksum of the observations from it to the last; 0: of none."""

    def body(self, first: "Body") -> "Body":
        """Return the body up to that tick's decision, from the one at the beginning."""
        grown, retired = self.grown, self.retired
        return msgspec.structs.replace(first, grown=grown, retired=retired)


def seen_after(checksum: int, bits: bytes, known: bytes) -> int:
    """Return a checksum with one more observation, as it is packed."""
    return zlib.crc32(known, zlib.crc32(bits, checksum))


def first_number(past: ResumePoint | None, who: str) -> int:
    """Return the number of the first message of a part."""
    return 0 if past is None else past.counts.get(who, 0)
