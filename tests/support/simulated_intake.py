"""The intake of a simulated run: it dies and restarts while readings keep arriving.

The source and its journal are the real ones. What each row must be, and what must have
been received by then, is noted here besides.
"""

from collections import Counter

import numpy as np

from neurosnap import wire
from neurosnap.errors import PartDiedError
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_or_late import Bits, LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.protocol import Observed
from tests.support.fake_time import FakeTime, timed
from tools.simulate.check import WrongError
from tools.simulate.simulated_faults import DECADES, Case
from tools.simulate.source import source_of

_DIED = "intake: must not end before it is asked to, is gone"


class _Time(FakeTime):
    """A clock that is waited for only while readings are to come."""

    def wait(self, timeout: float | None = None) -> bool:
        if not self._events:
            raise WrongError("source: must have a row by now, waits for one")
        return super().wait(timeout)


class Intake:
    """A live `Source` whose process may die; the swarms ask it, one after the other.

    What the file of its run says comes in over and over.
    """

    live: bool = True
    discrete: bool = False
    length: int | None = None

    def __init__(self, case: Case) -> None:
        self._case, self._chance = case, case.chance
        self._file = source_of(case.options)
        self.sensors, self.orders = self._file.sensors, self._file.orders
        self.actions = self._file.actions
        self._time = _Time()
        self._time.epoch = 2 * DECADES
        self.rows: list[Observed] = []
        """What each tick must show."""
        self._counted = Counter[str]()  # readings, by what becomes of them
        self._died = self._gaps = 0  # how often, in all and since the last row
        self._taken: dict[int, bool] = {}  # what was read since, by sensor
        self._begin()

    def _begin(self, deaf: str = "") -> None:
        """Begin a process that goes on with the journal."""
        folder, ticks = self._case.log.with_name("journal"), self._case.options.ticks
        journal = Journal(folder, self.sensors, deaf)
        latest = LatestReadings(self.sensors)
        source = LiveSource(latest, OnChange(), journal=journal, most=ticks)
        self._source = timed(source, self._time, self._time.epoch)
        self._latest, self._fresh = self._taken.copy(), True

    def resume_after(self, tick: int) -> Bits | None:
        """Let the row after a tick be the next; see `LiveSource`."""
        return self._source.resume_after(tick)

    def first(self) -> Observed | None:
        """Return the first row."""
        return self.step(-1)

    def step(self, action: int) -> Observed | None:
        """Return the next row; while none is there, readings come, or PartDiedError."""
        source = self._source
        self._await_row()
        return source.step(action) if source.given else source.first()

    def close(self) -> None:
        """Do nothing: it outlives the swarm."""

    def check(self) -> None:
        """Hold what it counted against what came in.

        Raises:
            WrongError: It does not add up.
        """
        counts = self._source.statistics()
        found, came = counts.received.total + counts.after, self._counted.total()
        if found != came:
            raise WrongError(f"received: must be {came}, got {counts}")

    def _receive(self) -> None:
        """Receive some readings; before each the clock may jump, or the intake die."""
        chance, weather, tally = self._chance, self._case.weather, self._case.tally
        for _ in range(chance.randint(1, 4)):
            if chance.random() < weather.jump:
                tally.jumps += 1
                self._time.epoch = chance.choice([1, 2, 3]) * DECADES
            if chance.random() < weather.gap:
                tally.gaps += 1
                self._die()
            if len(self.rows) < self._case.options.ticks:
                self._receive_one()
        self._await_row()

    def _await_row(self) -> None:
        """Let more readings come a second later, unless there is a row by now."""
        if self._source.given == len(self.rows):
            self._show_change()
        if self._source.given == len(self.rows):
            self._time.at(self._time.now + 1, self._receive)

    def _die(self) -> None:
        self._source.close()
        for _ in range(self._chance.randrange(3)):
            self._line()  # nothing hears it
        self._died, self._gaps = self._died + 1, self._gaps + 1
        self._begin(_DIED)
        raise PartDiedError(_DIED)

    def _line(self) -> Observed:
        """Return what comes next."""
        seen = self._file.step(-1) or self._file.first()
        if seen is None:
            raise ValueError("file: must hold readings")
        return seen

    def _receive_one(self) -> None:
        """Receive a whole reading, or one of a sensor; or what is late, or is none."""
        source, line = self._source, self._line()
        known = line.known if line.known is not None else np.ones_like(line.bits)
        whole = [bool(b) if k else None for b, k in zip(line.bits, known, strict=True)]
        now = self._time.epoch + self._time.now
        sensor = self._chance.randrange(len(whole))
        name, on = self.sensors[sensor], bool(line.bits[sensor])
        match self._chance.choice(["whole", "one", "late", "refused"]):
            case "whole":
                source.receive_whole(whole, now)
                self._counted["shown"] += 1
                self._latest = {n: b for n, b in enumerate(whole) if b is not None}
                self._show()
            case "refused":
                source.refuse("reading: must be one")
                self._counted["refused"] += 1
            case kind:
                source.receive({name: on}, now)
                self._counted["shown"] += 1
                self._latest[sensor] = self._taken[sensor] = on
                if kind == "late":
                    source.receive({name: not on}, now - 3600)
                    self._counted["late"] += 1

    def _show_change(self) -> None:
        """Expect a row of the latest readings, if they differ from the last row."""
        bits, known = self._read()
        last = self.rows[-1] if self.rows else Observed(bits, ~bits & ~known)
        before = np.ones_like(bits) if last.known is None else last.known
        if not np.array_equal((bits, known), (last.bits, before)) and known.any():
            self._show()

    def _read(self) -> tuple[Bits, Bits]:
        places = range(len(self.sensors))
        bits = np.array([self._latest.get(place, False) for place in places])
        return bits, np.array([place in self._latest for place in places])

    def _show(self) -> None:
        """Expect a row of the latest readings."""
        bits, known = self._read()
        received = wire.Received(**self._counted, outages=self._died)
        outages = (wire.Outage(0.0, 0.0, _DIED),) * self._gaps
        some, fresh = None if known.all() else known, self._fresh
        self.rows.append(Observed(bits, some, fresh, fresh, received, outages))
        self._taken, self._gaps, self._fresh = {}, 0, False
