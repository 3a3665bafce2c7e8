"""Sources that return readings given by the test."""

import threading
from collections.abc import Sequence

import numpy as np

from neurosnap.errors import NeurosnapError
from neurosnap.sources.protocol import Observed


class Scripted:
    """Shows rows of readings, one after the other; None is unknown."""

    orders: tuple[int, ...] = ()
    exclusive: bool = True
    discrete: bool = False
    length: int | None = None
    live: bool = False

    def __init__(
        self, rows: Sequence[Sequence[bool | None]], actions: Sequence[str] = ()
    ) -> None:
        self.sensors: tuple[str, ...] = tuple(f"s{k}" for k in range(len(rows[0])))
        self.actions: tuple[str, ...] = tuple(actions)
        self.taken: list[int] = []
        self.closed = 0
        self._rows = rows
        self._next = 0

    def first(self) -> Observed | None:
        self._next = 0
        return self._show(begins=True)

    def step(self, action: int) -> Observed | None:
        self.taken.append(action)
        return self._show()

    def _show(self, *, begins: bool = False, cut: bool = False) -> Observed | None:
        if self._next == len(self._rows):
            return None
        row = self._rows[self._next]
        self._next += 1
        known = np.array([on is not None for on in row])
        # What is unknown means nothing, so it may be anything.
        bits = np.array([on is not False for on in row])
        return Observed(bits, None if known.all() else known, begins, cut)

    def close(self) -> None:
        self.closed += 1


class Live(Scripted):
    """One that makes its caller wait until the test lets it go on."""

    live = True

    def __init__(
        self, rows: Sequence[Sequence[bool | None]], actions: Sequence[str] = ()
    ) -> None:
        super().__init__(rows, actions)
        self.waits = threading.Event()
        self.fails = False
        self._due = threading.Semaphore(0)

    def let_go(self, ticks: int = 1) -> None:
        """Let so many ticks come."""
        self._due.release(ticks)

    def step(self, action: int) -> Observed | None:
        self.taken.append(action)
        fresh = not self._next  # it was not listened to before
        return self._show(begins=fresh, cut=fresh)

    def close(self) -> None:
        super().close()
        self._due.release(1000)

    def _show(self, *, begins: bool = False, cut: bool = False) -> Observed | None:
        self.waits.set()
        self._due.acquire()
        self.waits.clear()
        if self.fails:
            raise NeurosnapError("sensors: must answer, got nothing")
        return None if self.closed else super()._show(begins=begins, cut=cut)
