"""Reorders messages so that each reply follows its request.

The coordinator asks for an observation by the decision before it, starts every wave,
asks the cells for what they have read, tells workers what to learn, and says when there
is a key-frame. Whatever answers any of these was sent later, and may yet come earlier.
"""

from collections.abc import Iterator
from typing import NamedTuple

from neurosnap import wire


class Arrival(NamedTuple):
    """A received message, and when it came."""

    message: wire.Message
    delivery: wire.Delivery
    log_time: int
    """When it came, nanoseconds since the epoch."""


class CoordinatorProgress(NamedTuple):
    """The progress of the coordinator, by the messages it has sent."""

    tick: int = 0
    """The last tick of which it asked for the observation."""
    wave: int = 0
    """The last wave it started."""
    recalled: tuple[int, int] = (0, 0)
    """Tick and round of its last question to the histories."""
    learn: int = 0
    """The last tick it told workers to learn."""
    frame: int = 0
    """The tick of its last key-frame."""

    def after(self, message: wire.Message) -> "CoordinatorProgress":
        """Return how far it is with one more message, of any sender."""
        match message:
            case wire.WaveStart(wave=wave) if wave > self.wave:
                return self._replace(wave=wave)
            case wire.Decision(tick=tick) if tick >= self.tick:
                return self._replace(tick=tick + 1)
            case wire.Recall(tick=tick, round=number):
                return self._replace(recalled=max(self.recalled, (tick, number)))
            case wire.Learn(tick=tick) if tick > self.learn:
                return self._replace(learn=tick)
            case wire.KeyFrame(tick=tick) if tick > self.frame:
                return self._replace(frame=tick)
            case _:
                return self

    def is_before(self, message: wire.Message) -> bool:
        """Tell whether a message answers a later word of the coordinator.

        What answers nothing never does.
        """
        match message:
            case wire.Observation():
                return message.tick > self.tick
            case (
                wire.Pulse()
                | wire.CellReport()
                | wire.PulseBatch()
                | wire.WorkerReport()
            ):
                return message.wave > self.wave
            case wire.Recalled():
                return (message.tick, message.round) > self.recalled
            case wire.Learned():
                return message.tick > self.learn
            case wire.Band():
                return message.tick > self.frame
            case _:
                return False


class CausalOrder:
    """Holds each reply back until the request that it answers.

    Each sender's own order is kept. The word may be lost, or never have been said: so
    what waits is let go after `patience` nanoseconds, and bounded by what comes in that
    time.
    """

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self._said = CoordinatorProgress()
        self._early: list[Arrival] = []
        self._behind: set[str] = set()  # who has something in there

    @property
    def asked(self) -> int:
        """The last tick of which the observation was asked for."""
        return self._said.tick

    def add(self, heard: Arrival) -> Iterator[Arrival]:
        """Add a message; yield those that need not wait any longer."""
        if self._keep(heard, heard.log_time):
            return
        yield heard
        said, self._said = self._said, self._said.after(heard.message)
        if self._said != said:
            yield from self.due(heard.log_time)

    def due(self, now: int) -> Iterator[Arrival]:
        """Yield the messages that need not wait any longer, or have waited long enough.

        Args:
            now: The clock that messages came by, nanoseconds since the epoch.
        """
        for early in self.rest():
            if not self._keep(early, now):
                yield early

    def rest(self) -> list[Arrival]:
        """Return all messages that still wait, and release them."""
        early, self._early, self._behind = self._early, [], set()
        return early

    def upcoming(self, sender: str) -> int:
        """Return the number after the highest of `sender` that waits; 0: none does."""
        numbers = [
            early.delivery.sequence + 1
            for early in self._early
            if early.message.sender == sender
        ]
        return max(numbers, default=0)

    def _keep(self, heard: Arrival, now: int) -> bool:
        """Keep a message that has to wait, or is behind one of its sender's."""
        sender = heard.message.sender
        may_wait = now <= heard.log_time + self._patience
        is_early = may_wait and self._said.is_before(heard.message)
        if sender not in self._behind and not is_early:
            return False
        self._early.append(heard)
        self._behind.add(sender)
        return True
