"""Completeness of a recording: gaps in each sender's sequence numbers.

Every sender numbers all it sends from 0. A number that never came is a lost message,
one that came twice a message delivered twice, whatever order they came in: a repaired
loss arrives late and closes its gap. What was lost at the very end shows only against
the sender's own word for how many it sent.

Of a run that is recorded in several files each has a share of every sender's numbers;
what comes before that is none of its business.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping
from operator import itemgetter
from types import MappingProxyType

import msgspec

_NOTHING: Mapping[str, int] = MappingProxyType({})


class Completeness(msgspec.Struct, frozen=True):
    """The messages of each part that a recording holds, and those that it lacks."""

    messages: int
    """Messages recorded, each once."""
    missing: dict[str, int] = {}
    """For each sender that lost any, how many, those at the very end included."""
    duplicates: int = 0
    """Messages that came again and were left out."""
    foreign: int = 0
    """Payloads that are no message of this protocol and were left out."""
    vanished: tuple[str, ...] = ()
    """Its files that others took or changed, or the disk, while they were written."""
    gaps: int = 0
    """Places where messages are missing and no number shows that: they were lost from a
    recording that it took over, or their numbers were another part's, too."""

    @property
    def whole(self) -> bool:
        """Nothing that was sent is missing, nor any file."""
        return not (self.missing or self.vanished or self.gaps)


def added_up(balances: Iterable[Completeness]) -> Completeness:
    """Return what several files of one run hold together."""
    messages = duplicates = foreign = gaps = 0
    missing: Counter[str] = Counter()
    vanished: list[str] = []
    for balance in balances:
        messages += balance.messages
        duplicates += balance.duplicates
        foreign += balance.foreign
        missing.update(balance.missing)
        vanished += balance.vanished
        gaps += balance.gaps
    lost = dict(sorted(missing.items()))
    return Completeness(messages, lost, duplicates, foreign, tuple(vanished), gaps)


class RunningNumbers:
    """The sequence numbers received from each sender, and the gaps in them.

    Memory grows with the senders and the open gaps, not with the messages.

    Args:
        first: The number each sender's share begins with; 0 where it is not in here.
        anywhere: A share that is not in `first` begins with what comes first.
    """

    def __init__(
        self, first: Mapping[str, int] = _NOTHING, *, anywhere: bool = False
    ) -> None:
        self.duplicates = 0
        self._anywhere = anywhere
        self._first = dict(first)
        self._next = dict(first)
        # For each sender, the numbers below its next that have not come: disjoint
        # half-open ranges, ascending, none empty. A sender without any is not in here.
        self._gaps: dict[str, list[tuple[int, int]]] = {}

    @property
    def first(self) -> dict[str, int]:
        """The number that each sender's share begins with, as far as it is known."""
        return dict(self._first)

    def begin(self, sender: str, first: int) -> None:
        """Let a sender's share begin with number `first`, unless it has begun."""
        self._first.setdefault(sender, first)
        self._next.setdefault(sender, first)

    def receive(self, sender: str, sequence: int) -> bool:
        """Count one message; constant time as long as they come in order.

        Args:
            sender: Who sent it.
            sequence: Its running number, at least 0.

        Returns:
            Whether it came for the first time. A duplicate is counted.
        """
        upcoming = self._next.get(sender)
        if upcoming is None:
            upcoming = sequence if self._anywhere else 0
            self._first[sender] = upcoming
        if sequence == upcoming:
            self._next[sender] = sequence + 1
            return True
        if sequence > upcoming:
            self._gaps.setdefault(sender, []).append((upcoming, sequence))
            self._next[sender] = sequence + 1
            return True
        if self._fill(sender, sequence):
            return True
        self.duplicates += 1
        return False

    def _fill(self, sender: str, sequence: int) -> bool:
        """Take `sequence` out of the sender's gaps; return whether it was in one."""
        gaps = self._gaps.get(sender, [])
        index = bisect_right(gaps, sequence, key=itemgetter(0)) - 1
        if index < 0 or sequence >= gaps[index][1]:
            return False
        start, stop = gaps[index]
        rest = ((start, sequence), (sequence + 1, stop))
        gaps[index : index + 1] = [gap for gap in rest if gap[0] < gap[1]]
        if not gaps:
            del self._gaps[sender]
        return True

    def upcoming(self, sender: str) -> int:
        """Return the number after the highest that came from `sender`."""
        return self._next.get(sender, 0)

    @property
    def messages(self) -> int:
        """How many messages came, each counted once."""
        span = sum(self._next.values()) - sum(self._first.values())
        return span - sum(
            stop - start for gaps in self._gaps.values() for start, stop in gaps
        )

    def gaps(
        self, expected: Mapping[str, int] = _NOTHING
    ) -> dict[str, list[tuple[int, int]]]:
        """Return which numbers are missing, as half-open ranges, ascending.

        Args:
            expected: How many messages each sender says it sent; a sender that is not
                in here is taken to have sent nothing after its last that came.
        """
        gaps = {sender: list(ranges) for sender, ranges in self._gaps.items()}
        for sender, count in expected.items():
            upcoming = self._next.get(sender, 0)
            if count > upcoming:
                gaps.setdefault(sender, []).append((upcoming, count))
        return gaps

    def completeness(
        self, expected: Mapping[str, int] = _NOTHING, *, foreign: int = 0
    ) -> Completeness:
        """Return the balance, against what each sender says it sent.

        Args:
            expected: As in `gaps`.
            foreign: How many payloads were no message at all.
        """
        missing = {
            sender: sum(stop - start for start, stop in ranges)
            for sender, ranges in sorted(self.gaps(expected).items())
        }
        return Completeness(self.messages, missing, self.duplicates, foreign)
