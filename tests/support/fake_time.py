"""A fake clock that advances only in waits, and a condition that counts waiters."""

import threading
from collections.abc import Callable

from neurosnap.sources.live.latest_or_late import ClockMapping
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.statistics import Refusals


class FakeTime(threading.Condition):
    """A clock, and a condition whose waits let it run on.

    During a wait, events happen at their times, in order, on the same thread;
    the wait is over once those of one moment notify, or at its time-out.
    """

    def __init__(self, now: float = 0.0) -> None:
        super().__init__()
        self.now, self.epoch = now, 0.0
        self.waits = 0
        self._events: list[tuple[float, Callable[[], object]]] = []
        self._notified = False

    def clock(self) -> float:
        return self.now

    def at(self, time: float, event: Callable[[], object]) -> None:
        self._events.append((time, event))
        self._events.sort(key=lambda e: e[0])

    def pass_until(self, time: float, *, waiting: bool = False) -> None:
        """Let events happen up to and at `time`."""
        self._notified = False
        while self._events and self._events[0][0] <= time:
            self.now = max(self.now, self._events[0][0])
            while self._events and self._events[0][0] <= self.now:
                self._events.pop(0)[1]()
            if waiting and self._notified:
                return
        self.now = max(self.now, time)

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout is not None
        assert timeout > 0
        self.waits += 1
        self.pass_until(self.now + timeout, waiting=True)
        return self._notified

    def notify_all(self) -> None:
        self._notified = True


def timed(source: LiveSource, time: FakeTime, epoch: float = 0.0) -> LiveSource:
    """Let a source that is not used yet go by a fake clock, and wait in it.

    The clock shows 0 at `epoch`, in seconds since 1970.
    """
    source._clock, source._condition = time.clock, time
    time.epoch = epoch
    source._wall = lambda: time.epoch + time.now
    source._stamps = ClockMapping(time.now, epoch + time.now)
    source._refusals = Refusals(time.clock)
    return source


class Told(threading.Condition):
    """Shows when a thread waits in it."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting = threading.Event()

    def wait(self, timeout: float | None = None) -> bool:
        self.waiting.set()
        return super().wait(timeout)
