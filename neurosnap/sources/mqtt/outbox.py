"""A bounded queue that holds messages until the broker is back.

Two kinds of messages, since they age differently. A *held* one says how things are: the
latest of its topic counts, the broker retains it, and a broker that lost its memory is
told again. A *passing* one says what to do or what has happened: it is worth sending
for `LASTS` seconds and then no more, because a door must not open when the broker comes
back an hour after it was told to.

Pure: no clock and no threads.
"""

from collections import deque
from typing import NamedTuple

WAITING = 256
"""Passing messages that may wait; of more, the oldest is dropped."""
LASTS = 5.0
"""Seconds for which a passing message is worth sending."""
TOGETHER = 16
"""Messages on their way at a time; paho lets 20 be in flight."""


class Outgoing(NamedTuple):
    """A message that waits to be published: topic, payload, whether it is kept."""

    topic: str
    """Where to."""
    payload: bytes
    """What."""
    retain: bool = False
    """Whether the broker keeps it."""


class Outbox:
    """The messages that the broker has yet to get."""

    def __init__(self) -> None:
        self._held: dict[str, bytes] = {}
        self._unsent: dict[str, None] = {}  # topics of held ones, oldest first
        self._passing: deque[tuple[float, Outgoing]] = deque()
        self.dropped = 0
        """Passing messages that were given up, too old or too many."""

    def hold(self, topic: str, payload: bytes) -> bool:
        """Let `payload` be what `topic` says; return whether that is new. O(1)."""
        if self._held.get(topic) == payload:
            return False
        self._held[topic] = payload
        self._unsent.setdefault(topic)
        return True

    def send(self, message: Outgoing, now: float) -> None:
        """Let `message` be sent, if that can be done soon. O(1)."""
        if len(self._passing) == WAITING:
            self._passing.popleft()
            self.dropped += 1
        self._passing.append((now + LASTS, message))

    def renew(self) -> None:
        """Let all that is held be sent again: the broker may have forgotten it."""
        self._unsent = dict.fromkeys(self._held)

    def batch(self, now: float) -> list[Outgoing]:
        """Return what to send next, at most `TOGETHER`; nothing is taken out.

        What has a topic in common keeps its order, which only one batch after the other
        can promise: so no topic is in a batch twice. Passing messages go first.
        """
        self._expire(now)
        chosen: dict[str, Outgoing] = {}
        for _, message in self._passing:
            if message.topic in chosen or len(chosen) == TOGETHER:
                break
            chosen[message.topic] = message
        for topic in self._unsent:
            if len(chosen) == TOGETHER:
                break
            if topic not in chosen:
                chosen[topic] = Outgoing(topic, self._held[topic], retain=True)
        return list(chosen.values())

    def sent(self, message: Outgoing) -> None:
        """Take out one of a batch, which the broker has, or may have.

        What was held anew meanwhile stays. O(`WAITING`).
        """
        for place, (_, waiting) in enumerate(self._passing):
            if waiting is message:
                del self._passing[place]
                return
        if self._held.get(message.topic) == message.payload:
            self._unsent.pop(message.topic, None)

    def _expire(self, now: float) -> None:
        while self._passing and self._passing[0][0] <= now:
            self._passing.popleft()
            self.dropped += 1

    def __len__(self) -> int:
        """Return how many messages wait."""
        return len(self._passing) + len(self._unsent)
