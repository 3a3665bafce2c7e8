"""Iterates over ticks: reading, state and decision together.

What belongs to a tick comes from several senders and so in any order, but never far
apart: each sender waits for the others. A tick is given out once it is whole and
its turn has come; only what is under way is held in memory.
"""

from collections.abc import Iterator

import msgspec

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording

TOPICS = ("observation", "state", "decision")
WINDOW = 1024
"""Ticks that may be under way; one that is still incomplete then has lost something."""


class Tick(msgspec.Struct):
    """What was recorded of one tick; None for what was not."""

    number: int
    observation: wire.Observation | None = None
    sent: int = 0
    """When the observation was sent, nanoseconds since the epoch."""
    state: wire.State | None = None
    settled: int = 0
    """When the state was recorded, likewise."""
    decision: wire.Decision | None = None

    @property
    def known(self) -> bool:
        """What was read and what followed from it are both there."""
        return self.observation is not None and self.state is not None

    @property
    def whole(self) -> bool:
        """All there is of a tick is there; the last one of a run has no decision."""
        return self.known and self.decision is not None


class InOrder:
    """Puts messages together to ticks.

    Args:
        recording: Where they come from.
    """

    def __init__(self, recording: Recording) -> None:
        self._path = recording.path
        self._before = recording.begins
        self._last = self._before
        self._under_way: dict[int, Tick] = {}
        self._closing = recording.closing

    def add(self, recorded: Recorded) -> list[Tick]:
        """Add a message of one of `TOPICS`; return the ticks whose turn has come.

        Raises:
            RecordingError: Its tick was given out already.
        """
        message = recorded.message
        if not isinstance(message, wire.Observation | wire.State | wire.Decision):
            return []
        if message.tick <= self._before:  # what opens the run, or of an earlier file
            return []
        if message.tick <= self._last:
            rule = f"must come once, within {WINDOW} ticks of its turn"
            raise RecordingError(f"{self._path}: tick: {rule}, got {message.tick}")
        tick = self._under_way.setdefault(message.tick, Tick(message.tick))
        match message:
            case wire.Observation():
                tick.observation, tick.sent = message, recorded.sent
            case wire.State():
                tick.state, tick.settled = message, recorded.log_time
            case wire.Decision():
                tick.decision = message
        return self._due()

    def rest(self) -> list[Tick]:
        """Return the ticks still under way, where nothing more will come."""
        rest = [self._release(number) for number in sorted(self._under_way)]
        # Where another file follows, the last decision is said again in that one.
        closing = self._closing
        if rest and closing is not None and closing.tick == rest[-1].number:
            rest[-1].decision = closing
        return rest

    def _due(self) -> list[Tick]:
        due: list[Tick] = []
        while (
            following := self._under_way.get(self._last + 1)
        ) is not None and following.whole:
            due.append(self._release(following.number))
        while len(self._under_way) > WINDOW:
            due.append(self._release(min(self._under_way)))
        return due

    def _release(self, number: int) -> Tick:
        self._last = number
        return self._under_way.pop(number)


def ticks(recording: Recording) -> Iterator[Tick]:
    """Yield the ticks of a recording in order, those that lack something included.

    Raises:
        RecordingError: While iterating: the recording is damaged.
    """
    order = InOrder(recording)
    for recorded in recording.messages(TOPICS):
        yield from order.add(recorded)
    yield from order.rest()
