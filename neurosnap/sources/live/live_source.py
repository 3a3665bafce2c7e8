"""A live source: readings arrive at any time and are turned into ticks.

Two threads meet here. A feeder's thread hands readings in; the world's thread waits in
`first` or `step` until a tick is due. Both hold one lock for a few microseconds, and
the data between them is bounded: a single reading replaces its sensor's previous one,
and at most `WAITING` rows are queued, or `ROOM` plus those a feeder had read by then.

Whole readings come first: each is a tick of its own, in the order they came, and the
schedule is not asked. Only when none waits does the schedule decide when the latest
readings are a tick.

With a journal each row (the readings of one tick) is written as soon as it is certain
to get a tick: a whole reading when it arrives, the latest readings when they become a
tick. What is not yet in a row is written, too, before `receive` returns. After a
restart the same rows are given again (`resume_after`), and those readings are the
latest. While no tick is waited for (`keep_changes`), the clock does not turn the latest
readings into rows, but each change of them becomes one, within the limits of the
schedule and of `WAITING`: so a restart hides no more changes than a busy swarm does.

Every reading is counted once, by what becomes of it (`wire.Received`): it is shown by
the row that follows, or it is late, refused or dropped. A row says what was received up
to it, so the counts survive with it.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Literal, Protocol

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.errors import NeurosnapError, ShapeError
from neurosnap.sources.live.journal import Journal, JournalRow, Readings, Taken
from neurosnap.sources.live.latest_or_late import Bits, ClockMapping, LatestReadings
from neurosnap.sources.live.signal_readers import Readers, SignalReaders
from neurosnap.sources.live.statistics import Fate, Refusals, Statistics
from neurosnap.sources.live.tick_schedule import TickSchedule
from neurosnap.sources.meaning import Numbers
from neurosnap.sources.protocol import Observed

WAITING = 1 << 16
"""Readings that may wait for their tick: half a minute of 2,000 a second."""
CHANGES = 64
"""Rows that wait at most where a change becomes one: further ones are joined, as they
are between two ticks."""
ROOM = 1024
"""Readings that wait when a feeder that can hold its writer back does so."""
_SLOW = (
    "source: a tick is late; if that goes on, `neurosnap ps` says which part it waits"
    " for (--cells inline is fastest, or take a longer interval or min_interval)"
)

_logger = logging.getLogger(__name__)
_LONGEST = 86_400.0  # seconds to wait before looking again; a wait cannot be any number


class Feeder(Protocol):
    """Brings readings to a source, from a thread of its own."""

    def start(self, source: "LiveSource") -> None:
        """Begin, and return without waiting; called once.

        From then on it may call, from any thread, the source's `receive`,
        `receive_whole`, `refuse`, `listens`, `end` and `fail`;
        what it cannot do it reports by `fail`.
        """

    def stop(self) -> None:
        """End, and return once nothing more is handed in; also without a start, twice.

        The source is closed already: a feeder that waits for room is on its way out.
        """


class LiveSource:
    """A live `Source` over the latest readings and a schedule.

    Args:
        latest: Holds the latest readings; used by this source alone from now on.
        schedule: Says when a tick is due; likewise.
        feeder: Is started with the first tick and stopped by `close`; if None, the
            owner of the source hands readings in.
        actions: The names of the atomic actions, one of which is taken at each step.
        actuate: Carries out the choice that `step` is called with, if there are
            actions; on the world's thread, so it should not take long.
        journal: Where rows are written before they are given; None for nowhere.
        most: Rows that there are to be at most; None for no bound.

    Attributes:
        readers: For feeders that hear of signals; each sensor is one unless it is set.
        numbers: Those that it compares; none unless it is set.
    """

    live: bool = True
    discrete: bool = False
    length: int | None = None
    _asked = 0.0  # when a swarm first asked for a row: nothing waited for it before

    def __init__(
        self,
        latest: LatestReadings,
        schedule: TickSchedule,
        *,
        feeder: Feeder | None = None,
        actions: Sequence[str] = (),
        actuate: Callable[[int], None] | None = None,
        journal: Journal | None = None,
        most: int | None = None,
    ) -> None:
        self.readers: Readers = SignalReaders(dict.fromkeys(latest.sensors, (None,)))
        self.numbers = Numbers()
        self.sensors: tuple[str, ...] = latest.sensors
        self.orders: tuple[int, ...] = (0,) * len(latest.sensors)
        self.actions: tuple[str, ...] = tuple(actions)
        self.journal = journal
        self.resumed = journal is not None and journal.last > 0
        """It goes on with a run that had its first tick before."""
        self.over = False
        """Its run is: nothing need be kept for another process that goes on with it."""
        self.given = 0
        """The tick of the row that was given last."""
        self._latest = latest
        self._schedule = schedule
        self._feeder = feeder
        self._actuate = actuate
        self._clock: Callable[[], float] = time.monotonic
        self._wall: Callable[[], float] = time.time  # what readings are stamped in
        self._condition = threading.Condition()
        self._number = {name: k for k, name in enumerate(latest.sensors)}
        self._most = most
        self._rows = 0 if journal is None else journal.last  # rows there are, in all
        self._fresh = True  # readings before the next row were missed
        self._waiting: deque[JournalRow] = deque()  # an eighth of what they unpack to
        self._shown: Observed | None = None  # the last row, be it given or waiting
        self._turn = 0  # a waiting call ends when this has changed; see `wake_reader`
        self._away = False
        self._stamps = ClockMapping(self._clock(), self._wall())
        # Serializes `start` and `stop`: no start after a stop, no stop during a start.
        self._feeding = threading.Lock()
        self._sensitive = True  # a reading may bring the next tick nearer
        self._started = self._ended = self._closed = False
        self._error: BaseException | None = None
        self._refusals = Refusals(self._clock)
        self._received = wire.Received() if journal is None else journal.taken.received
        self._in_rows = 0 if journal is None else journal.received.shown
        # Since the last row.
        self._outages = () if journal is None else journal.taken.outages
        self._deaf = None if journal is None else journal.deaf  # since when, and why
        self._listening = False
        self._heard = False  # a feeder that says when it listens has done so
        self._slow = False  # that it is too slow was said

    def first(self) -> Observed | None:
        """Start the feeder, unless it is on its way, and wait as `step` does."""
        with self._condition:
            if self.journal is None:
                self._fresh = True
                if not self._waiting:  # else the last of these is the last row
                    self._shown = None
        return self._tick()

    def step(self, action: int) -> Observed | None:
        """Carry out `action`, unless there are no actions, and wait for the next tick.

        It may be the first call, where a run goes on that had its first tick before.

        Returns:
            The readings; None if the source is closed, or its feeder has come to an
            end.

        Raises:
            NeurosnapError: What the feeder failed of.
        """
        if self._actuate is not None and self._is_new_action():
            self._actuate(action)
        self.resumed |= not self._started
        return self._tick()

    def resume_after(self, tick: int) -> Bits | None:
        """Continue with the row after `tick`.

        With a journal this comes before anything is asked; without one it does nothing.

        Returns:
            Which readings were known at `tick`, ``(N,)``; None if all were, or its row
            is no longer there.

        Raises:
            NeurosnapError: The journal cannot be read.
        """
        with self._condition:
            if self.journal is None:
                return None
            before, rows, missing = self.journal.rows_after(tick)
            if missing:
                self._count("missing", missing)
                _logger.warning("journal: readings missing from it: %d", missing)
            count = len(self.sensors)
            shown = None if before is None else before.observed(count)
            self._waiting = deque(rows)
            self._asked = 0.0
            self._shown = rows[-1].observed(count) if rows else shown
            self._rows = self.journal.last
            self.given = tick
            self.resumed |= tick > 0
            return None if shown is None else shown.known

    def wake_reader(self) -> None:
        """Wake a caller that waits for a row; it gets None. From any thread."""
        with self._condition:
            self._turn += 1
            self._away = False
            self._condition.notify_all()

    def keep_changes(self) -> None:
        """Write each change that would be a row to the journal, until `wake_reader`.

        To be used while no tick is waited for. The next `first` or `step` raises the
        journal's error, if there is one.
        """
        if not self._started:
            self._start()
        with self._condition:
            self._away = True
            while self._away and not self._closed and self._error is None:
                now = self._clock()
                patience = self._keep_change(now)
                if patience != 0:
                    self._wait(now, patience)
            self._away = False

    def _keep_change(self, now: float) -> float | None:
        """Write the latest readings down if they have changed and are due.

        Returns:
            Seconds until they are due, 0 if they were written; None without a change.
        """
        seen = self._latest.observation(now)
        patience = self._patience(seen, now)
        self._sensitive = True
        if not self._is_change(seen) or self.is_full or len(self._waiting) >= CHANGES:
            return None
        if patience == 0:
            self._write_row(*seen)
            self._schedule.given(now)
        return patience

    def _write_row(self, bits: Bits, known: Bits) -> None:
        """Let a row wait; what the journal fails of, the next caller gets."""
        try:
            row = self._row(bits, known, self._wall())
            self._waiting.append(JournalRow.of(row))
        except NeurosnapError as error:
            self._error = error

    def close(self) -> None:
        """Wake a waiting caller and stop the feeder; from any thread, also twice."""
        with self._condition:
            self._closed = True
            self._refusals.flush()
            self._condition.notify_all()
        with self._feeding:
            if self._feeder is not None:
                self._feeder.stop()
        if self.journal is not None:
            self.journal.close()

    @property
    def is_full(self) -> bool:
        """There are all the rows that there are to be."""
        return self._most is not None and self._rows >= self._most

    def receive(
        self,
        readings: Mapping[str, bool | None],
        at: float | None = None,
        wrong: Sequence[str] = (),
    ) -> bool:
        """Receive one reading of some sensors: no tick shows half of it.

        From any thread, and without waiting.

        A name that is none of `sensors` is refused: a run has the sensors it began
        with.

        Args:
            readings: By name; None if a sensor does not know.
            at: When, in seconds since the epoch; if None, now.
            wrong: What of it was no reading, as for `refuse`.

        Returns:
            It is safe from the death of this process, if anything is.
        """
        with self._condition:
            if self.is_full or self._closed:
                self._count("shown")  # by no row, so it counts as after the last tick
                return self.is_full or self.over
            now = self._clock()
            taken = self._update(readings, at, now)
            strange = (unknown(each) for each in readings if each not in self._number)
            wrong = (*wrong, *strange)
            for text in wrong:
                self._refusals.refuse(text)
            safe = self._take(
                "shown" if taken else "refused" if wrong else "late", taken
            )
            if self._away:
                # Here, not in the waiting thread: readings may come before it wakes.
                self._keep_change(now)
            return safe

    def forget(self, sensors: Iterable[str], at: float | None) -> None:
        """Let sensors be unknown, of which nothing is said any more; from any thread.

        Nothing was received. What they are told later is not late after `at`.
        """
        with self._condition:
            if not (self.is_full or self._closed):
                self._keep(self._update(dict.fromkeys(sensors), at, self._clock()))

    def _update(
        self, readings: Mapping[str, bool | None], at: float | None, now: float
    ) -> Readings:
        """Update what was read last; return what is new, and when it was read."""
        as_of, stamp = self._as_of(at, now), self._wall() if at is None else at
        new: Readings = {}
        for sensor, on in readings.items():
            number = self._number.get(sensor)
            if number is not None and self._latest.update(number, on, as_of, now):
                new[number] = on, stamp
        if new:
            self._changed()
        return new

    def _take(self, fate: Fate, readings: Readings) -> bool:
        """Count a reading, and write it down until a row shows it; tell if it is."""
        self._count(fate)
        return self._keep(readings)

    def _keep(self, readings: Readings) -> bool:
        """Write down what a row will show, and when nothing was listened to."""
        taken = Taken(self._received, readings, self._outages, self._deaf)
        try:
            if self.journal is not None:
                self.journal.take(taken)
        except NeurosnapError as error:
            self.fail(error)
            return False
        return True

    def _count(self, fate: Fate | Literal["missing", "outages"], more: int = 1) -> None:
        """Count what came in."""
        counted = getattr(self._received, fate) + more
        self._received = msgspec.structs.replace(self._received, **{fate: counted})

    def _changed(self) -> None:
        """Wake the waiting thread, once per batch of changes."""
        if self._sensitive:
            self._sensitive = False
            self._condition.notify_all()

    def receive_whole(
        self,
        readings: Sequence[bool | None],
        at: float | None = None,
        *,
        spare: bool = False,
        wrong: Sequence[str] = (),
    ) -> None:
        """Receive a whole reading, which gets a separate tick; from any thread.

        Where `WAITING` of them wait already, it is dropped and counted.

        Args:
            readings: One a sensor; None if unknown. A reading without any known one
                gets no tick.
            at: When they were read, as for `receive`. Staleness and lateness do not
                matter for its own tick, only for what is left as the latest.
            spare: It is not dropped: the feeder waits for room before it reads more.
            wrong: What of it was no reading, as for `refuse`.

        Raises:
            ShapeError: There is not one a sensor.
        """
        if len(readings) != len(self.sensors):
            rule = f"must be {len(self.sensors)}, one a sensor"
            raise ShapeError("readings", rule, len(readings))
        on = np.array([reading is True for reading in readings])
        known = np.array([reading is not None for reading in readings])
        with self._condition:
            if self.is_full or self._closed:
                self._count("shown")
                return
            now = self._clock()
            self._latest.update_all(on, known, self._as_of(at, now), now)
            for text in wrong:
                self._refusals.refuse(text)
            if not known.any():
                self._take("refused" if wrong else "shown", {})
            elif not spare and len(self._waiting) >= WAITING:
                self._take("dropped", {})
                rule = f"must wait for fewer than {WAITING} others, dropped"
                self._refusals.refuse(f"reading: {rule}")
            else:
                self._count("shown")
                self._write_row(on, known)
            self._condition.notify_all()

    def wait_for_room(self) -> bool:
        """Wait, as a feeder, for room; false if no reading is wanted any more."""
        with self._condition:
            while len(self._waiting) >= ROOM and not self._closed:
                self._condition.wait()
            return not self._closed and not self.is_full

    def refuse(self, text: str) -> None:
        """Count what is no reading; log ``name: rule, got value``, a line a second."""
        with self._condition:
            self._refusals.refuse(text)
            self._take("refused", {})

    def listens(self, on: bool) -> None:
        """Note whether the feeder listens from now on; from any thread.

        While it does not listen, silence says nothing of a sensor with `heard_within`.
        A feeder listens from its start, unless it says otherwise.
        """
        with self._condition:
            if on:
                self._latest.start_listening(self._clock())
                self._listening = self._heard = True
                self._end_outage()
            else:
                self._listening = False
                self._latest.stop_listening()
                if self._heard and self._deaf is None and not self._closed:
                    self._deaf = (self._wall(), "not connected")
                    self._keep({})
            self._condition.notify_all()

    def _end_outage(self) -> None:
        """Note that it listens again, if it did not and does."""
        if self._deaf is not None and self._listening:
            since, why = self._deaf
            self._outages += (wire.Outage(since, self._wall(), why),)
            self._deaf = None
            self._count("outages")
            self._keep({})

    def end(self) -> None:
        """End the source once all readings received were shown."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()

    def fail(self, error: BaseException) -> None:
        """Raise `error` in a caller that waits for a tick, unless the source is closed.

        Whole readings that came before have their ticks first.
        """
        with self._condition:
            self._error = error
            self._condition.notify_all()

    def statistics(self) -> Statistics:
        """Return what came in so far; from any thread."""
        with self._condition:
            deaf = self._deaf is not None
            return Statistics.of(self._received, self._in_rows, deaf)

    def _tick(self) -> Observed | None:
        if not self._started:
            self._start()
        with self._condition:
            self._asked = self._asked or self._wall()
            shown = self._next()
            if shown is None:
                return None
            due = max(shown.due, self._asked)
            late = self._wall() - due > self._schedule.slack
            if late and not self._slow:
                self._slow = True
                _logger.warning(_SLOW)
            due, waiting = (due, len(self._waiting)) if late else (0.0, 0)
            shown = msgspec.structs.replace(shown, due=due, waiting=waiting)
            self._schedule.given(self._clock())
            self.given += 1
            self._condition.notify_all()  # there is room for one more
        return shown

    def _is_new_action(self) -> bool:
        """Tell whether an action is to be carried out, and note that it is.

        It may have been asked for before, in a swarm that died then.
        """
        if not self.actions or self.journal is None:
            return bool(self.actions)
        with self._condition:
            return self.journal.begin_action(self.given)

    def _is_change(self, seen: tuple[Bits, Bits]) -> bool:
        """Tell whether `seen`, readings and which are known, differs from the last."""
        shown, (bits, known) = self._shown, seen
        if shown is None:
            return True
        same = (
            known.all() if shown.known is None else np.array_equal(shown.known, known)
        )
        return not (same and np.array_equal(shown.bits, bits))

    def _row(self, bits: Bits, known: Bits, due: float) -> Observed:
        """Return the next row, which was due then, once it is written down."""
        self._end_outage()  # a feeder may bring a row before it is known to have begun
        sure, begins = None if known.all() else known, self._fresh
        # What is live has no ends: what begins cut off what was before.
        row = Observed(
            bits,
            sure,
            begins,
            begins,
            self._received,
            self._outages,
            said=self.numbers.packed(sure),
            due=due,
        )
        if self.journal is not None:
            self.journal.write(JournalRow.of(row))
        self._shown, self._fresh = row, False
        self._in_rows, self._outages = self._received.shown, ()
        self._rows += 1
        return row

    def _start(self) -> None:
        with self._condition:
            now = self._clock()
            self._latest.start_listening(now)
            self._schedule.begin(now)
            self._listening = True
            if self.journal is not None:  # what another process took in
                for number, (on, at) in self.journal.taken.readings.items():
                    self._latest.update(number, on, self._as_of(at, now), now)
        with self._feeding:
            self._started = True
            if self._feeder is not None and not self._closed:
                self._feeder.start(self)
        with self._condition:
            self._end_outage()

    def _next(self) -> Observed | None:
        """Wait for what is to be shown next; None if nothing is any more."""
        turn, late = self._turn, True
        while not self._closed and turn == self._turn:
            if self._waiting:
                return self._waiting.popleft().observed(len(self.sensors))
            if self._error is not None:
                raise self._error
            now = self._clock()
            seen = self._latest.observation(now)
            patience = self._patience(seen, now)
            if patience == 0:
                due = self._schedule.due(now) if late else now
                return self._row(*seen, self._wall() - now + due)
            if self._ended:
                return None
            late = False
            self._wait(now, patience)
        return None

    def _wait(self, now: float, patience: float | None) -> None:
        """Wait until what is known may change, `patience` seconds at most."""
        turn = self._latest.next_change(now)
        until = _LONGEST if turn is None else min(_LONGEST, turn - now)
        self._condition.wait(until if patience is None else min(until, patience))

    def _patience(self, seen: tuple[Bits, Bits], now: float) -> float | None:
        """Return the seconds until `seen` is due; None if it makes no tick due."""
        changed = self._is_change(seen)
        self._sensitive = True
        if not seen[1].any():
            return None
        if self._ended:
            return 0.0 if changed else None
        patience = self._schedule.wait(now, changed)
        # A change that would not bring the tick forward need not wake the waiter.
        self._sensitive = patience != self._schedule.wait(now, True)
        return patience

    def _as_of(self, at: float | None, now: float) -> float:
        if at is None:
            return now
        return self._stamps.on_our_clock(at, now, self._wall())


def unknown(sensor: str) -> str:
    """Return the error text for a sensor that the run does not have."""
    return (
        f"sensor: must be one the run began with, got {sensor[:100]!r}"
        " (name it among the sensors and start again)"
    )
