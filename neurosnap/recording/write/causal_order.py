"""Reorders messages so that each reply follows its request.

The coordinator asks for an observation by the decision before it, starts every wave,
and asks the cells for what they have read; whatever is said of any of these was sent
later, and may yet come earlier.
"""

from collections.abc import Iterator
from typing import NamedTuple

from neurosnap import wire


class Heard(NamedTuple):
    """A message that came."""

    message: wire.Message
    delivery: wire.Delivery
    log_time: int
    """When it came, nanoseconds since the epoch."""


class CausalOrder:
    """Lets messages wait for the word of the coordinator that they answer.

    Each sender's own order is kept. The word may be lost, or never have been said: so
    what waits is let go after a while, and bounded by what comes in that time.

    Args:
        patience: How long a message waits, nanoseconds.
    """

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self._wave = 0  # the last that was heard to start
        self._tick = 0  # the last that was heard to be asked for
        self._round = (0, 0)  # tick and round that were last heard to be recalled
        self._early: list[Heard] = []
        self._behind: set[str] = set()  # who has something in there

    @property
    def asked(self) -> int:
        """The last tick of which the observation was asked for."""
        return self._tick

    def take(self, heard: Heard) -> Iterator[Heard]:
        """Take in a message; yield what there is nothing to wait for any more."""
        if self._keep(heard, heard.log_time):
            return
        yield heard
        match heard.message:
            case wire.WaveStart(wave=wave) if wave > self._wave:
                self._wave = wave
            case wire.Decision(tick=tick) if tick >= self._tick:
                self._tick = tick + 1
            case wire.Recall(tick=tick, round=number) if (tick, number) > self._round:
                self._round = tick, number
            case _:
                return
        yield from self.due(heard.log_time)

    def due(self, now: int) -> Iterator[Heard]:
        """Yield what has nothing to wait for any more, or has waited long enough.

        Args:
            now: The clock that messages came by, nanoseconds since the epoch.
        """
        for early in self.rest():
            if not self._keep(early, now):
                yield early

    def rest(self) -> list[Heard]:
        """Return what waits, and let it wait no longer."""
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

    def _keep(self, heard: Heard, now: int) -> bool:
        """Keep a message that has to wait, or is behind one of its sender's."""
        sender = heard.message.sender
        may_wait = now <= heard.log_time + self._patience
        is_early = may_wait and is_beyond(
            heard.message, self._tick, self._wave, self._round
        )
        if sender not in self._behind and not is_early:
            return False
        self._early.append(heard)
        self._behind.add(sender)
        return True


def is_beyond(
    message: wire.Message, tick: int, wave: int, recalled: tuple[int, int]
) -> bool:
    """Tell whether an answer is to a later word of the coordinator.

    Args:
        message: Of anybody; what answers nothing is never beyond.
        tick: The last that was asked for.
        wave: The last that was started.
        recalled: Tick and round of the last question to the histories.
    """
    match message:
        case wire.Observation():
            return message.tick > tick
        case wire.Pulse() | wire.CellReport() | wire.PulseBatch() | wire.WorkerReport():
            return message.wave > wave
        case wire.Recalled():
            return (message.tick, message.round) > recalled
        case _:
            return False
