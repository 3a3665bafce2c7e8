"""Sources that show what a test has written down."""

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import NeurosnapError


class Scripted:
    """Shows rows of readings, one after the other; None: unknown.

    Args:
        rows: What it shows.
        actions: The names of its actions.
    """

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
        self.begins = self.cut = self.paused = False
        self.known: NDArray[np.bool_] | None = None
        self.taken: list[int] = []
        self.closed = 0
        self._rows = rows
        self._next = 0

    def first(self) -> NDArray[np.bool_] | None:
        self._next, self.begins = 0, True
        return self._show()

    def step(self, action: int) -> NDArray[np.bool_] | None:
        self.taken.append(action)
        self.begins = False
        return self._show()

    def _show(self) -> NDArray[np.bool_] | None:
        if self._next == len(self._rows):
            return None
        row = self._rows[self._next]
        self._next += 1
        known = np.array([on is not None for on in row])
        self.known = None if known.all() else known
        # What is unknown means nothing, so it may be anything.
        return np.array([on is not False for on in row])

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

    def step(self, action: int) -> NDArray[np.bool_] | None:
        fresh = not self._next  # nobody has listened before
        shown = super().step(action)
        self.begins = self.cut = fresh
        return shown

    def close(self) -> None:
        super().close()
        self._due.release(1000)

    def _show(self) -> NDArray[np.bool_] | None:
        self.waits.set()
        self._due.acquire()
        self.waits.clear()
        if self.fails:
            raise NeurosnapError("sensors: must answer, got nothing")
        return None if self.closed else super()._show()
