"""A simulated network: messages overtake each other, come twice, or are lost.

The hub draws which link delivers next, so that messages of different senders overtake
each other while each link keeps its own order, as the protocol promises; it can also
repeat and lose messages, be slow on some links and cut others.
What is lost is counted, and leaves the trace the protocol promises: a gap in the
sender's numbers.
"""

import random
from collections import Counter
from dataclasses import dataclass

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub

_TRIES = 4  # draws after which even a slow link delivers


@dataclass(frozen=True)
class Faults:
    """How badly a simulated network behaves."""

    duplicate: float = 0.0
    """The probability that a message arrives once more, later."""
    drop: float = 0.0
    """The probability that a message does not arrive at one of its receivers."""
    spared: frozenset[tuple[str, str]] = frozenset()
    """Links, sender and receiver, that `drop` leaves alone."""
    slow: frozenset[tuple[str, str]] = frozenset()
    """Links that mostly deliver only when no other has anything waiting."""


class SimulatedHub(MemoryHub):
    """A hub that picks the order and the faults of its deliveries at random.

    Args:
        seed: Draws the order of deliveries and the faults.
        faults: What goes wrong, and how often.
    """

    def __init__(self, seed: int, faults: Faults | None = None) -> None:
        super().__init__()
        self.lost: Counter[tuple[str, str]] = Counter()
        """Deliveries that faults and cuts took, by sender and receiver."""
        self._random = random.Random(seed)
        self._faults = faults or Faults()
        self._cut: set[frozenset[str]] = set()

    def cut(self, a: str, b: str) -> None:
        """Lose everything between `a` and `b` until `heal`."""
        self._cut.add(frozenset((a, b)))
        for link in ((a, b), (b, a)):
            waiting = self._links.pop(link, ())
            for _ in waiting:
                self._queue.remove(link)
                self.lost[link] += 1

    def heal(self, a: str, b: str) -> None:
        """Let messages between `a` and `b` pass again; what was lost stays lost."""
        self._cut.discard(frozenset((a, b)))

    def _next_link(self) -> tuple[str, str]:
        # Any that waits may be next; which of its own messages it is does not matter,
        # because a link keeps its order.
        for _ in range(_TRIES):
            self._queue.rotate(self._random.randrange(len(self._queue)))
            if self._queue[0] not in self._faults.slow:
                break
        return super()._next_link()

    def _next_on(self, link: tuple[str, str]) -> wire.Delivery:
        delivery = super()._next_on(link)
        if self._chance(self._faults.duplicate):
            self._links[link].append(delivery)
            self._queue.append(link)
        return delivery

    def _loses(self, link: tuple[str, str]) -> bool:
        cut = bool(self._cut) and frozenset(link) in self._cut
        spared = link in self._faults.spared
        lost = cut or (not spared and self._chance(self._faults.drop))
        if lost:
            self.lost[link] += 1
        return lost

    def _chance(self, probability: float) -> bool:
        return probability > 0.0 and self._random.random() < probability
