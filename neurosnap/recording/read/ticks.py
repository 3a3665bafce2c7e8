"""Iterates over ticks: reading, state and decision together.

What belongs to a tick comes from several senders and so in any order, but never far
apart: each sender waits for the others. A tick is given out once it is whole and
its turn has come; only what is under way is held in memory.
"""

from collections.abc import Iterator

import msgspec

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.read.recording import Recording

_TOPICS = ("observation", "state", "decision")
WINDOW = 1024
"""Ticks that may be under way; one that is still incomplete then has lost something."""


class Tick(msgspec.Struct):
    """The recorded messages of one tick; those that are missing are None."""

    number: int
    observation: wire.Observation | None = None
    at: int = 0
    """When it was observed, nanoseconds since the epoch."""
    state: wire.State | None = None
    decision: wire.Decision | None = None

    @property
    def known(self) -> bool:
        """What was read and what followed from it are both there."""
        return self.observation is not None and self.state is not None

    @property
    def whole(self) -> bool:
        """All there is of a tick is there; the last one of a run has no decision."""
        return self.known and self.decision is not None


def ticks(recording: Recording) -> Iterator[Tick]:
    """Yield the ticks of a recording in order, those that lack something included.

    Raises:
        RecordingError: While iterating: the recording is damaged, or what belongs to a
            tick comes after it was given out.
    """
    before = last = recording.begins
    under_way: dict[int, Tick] = {}
    for recorded in recording.messages(_TOPICS):
        message = recorded.message
        if not isinstance(message, wire.Observation | wire.State | wire.Decision):
            continue
        if message.tick <= before:  # what opens the run, or of an earlier file
            continue
        if message.tick <= last:
            rule = f"must come once, within {WINDOW} ticks of its turn"
            raise RecordingError(f"{recording.path}: tick: {rule}, got {message.tick}")
        tick = under_way.setdefault(message.tick, Tick(message.tick))
        match message:
            case wire.Observation():
                tick.observation = message
                tick.at = round(message.at * 1e6) * 1000 or recorded.sent
            case wire.State():
                tick.state = message
            case wire.Decision():
                tick.decision = message
        while under_way:
            following = under_way.get(last + 1)
            if following is not None and following.whole:
                last += 1
            elif len(under_way) > WINDOW:
                last = min(under_way)
            else:
                break
            yield under_way.pop(last)
    # Where another file follows, the last decision is said again in that one.
    closing = recording.closing
    for number in sorted(under_way):
        if closing is not None and closing.tick == number == max(under_way):
            under_way[number].decision = closing
        yield under_way[number]
