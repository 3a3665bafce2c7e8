"""Which sensors of a run seem broken, found in the background."""

from collections.abc import Sequence
from contextlib import suppress

import msgspec

from neurosnap.apps.viewer.api import Health, RaisedAlarm, SensorHealth
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import ShapeError
from neurosnap.health.alarm import Alarm
from neurosnap.health.budget import NEVER
from neurosnap.health.follower import Follower
from neurosnap.recording.read.observed import as_observed

_BATCH = 256
"""Observations read at a time, or a chunk of them."""


class HealthView:
    """The health of a run's sensors, as far as its readings were read.

    Reading is for one thread at a time and may go on while others look.

    Args:
        run_view: A view of its own: it is read from one end to the other.
    """

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._tick = 0  # the last that was read
        self._follower: Follower | None = None
        self.raised: list[RaisedAlarm] = []
        """The alarms there were, by tick."""
        self._in_force: dict[int, Alarm] = {}  # by their places there
        options = run_view.options
        if options.alarms != NEVER:
            self._follower = Follower(options.body.own, options.alarms)
        self.health = self._now(done=self._follower is None)
        """What there is to say."""

    def read_on(self) -> bool:
        """Read some ticks more; return whether there were any.

        To learn anew takes seconds, sometimes.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        if self._follower is None:
            return False
        self._run_view.grow()
        before = self._tick
        index, body = self._run_view.tick_index, self._run_view.options.body
        for _, chunk in index.readable(index.chunk_of(before + 1), len(index)):
            for message, sent in chunk.observed():
                if message.tick > self._tick:
                    self._tick = message.tick
                    with suppress(ShapeError):  # it is of other sensors
                        at, on, known, begins = as_observed(message, sent, body)
                        said = self._follower.observe(on, known, at, begins=begins)
                        self._take(self._follower, said.begun, message.tick)
            if self._tick - before >= _BATCH:
                break
        more = self._tick > before
        if more or not self.health.done:
            self.health = self._now(done=not more)
        return more

    def _take(self, follower: Follower, begun: Sequence[Alarm], tick: int) -> None:
        """Take in what an observation told; an alarm may be over by its end again."""
        standing = {alarm.sensor: alarm for alarm in follower.standing.alarms}
        for place, alarm in list(self._in_force.items()):
            if standing.get(alarm.sensor) != alarm:
                was = self.raised[place]
                self.raised[place] = msgspec.structs.replace(was, until=tick)
                del self._in_force[place]
        for alarm in begun:
            number = self._run_view.options.body.own.index(alarm.sensor)
            raised = RaisedAlarm(tick, number, alarm.line())
            if standing.get(alarm.sensor) == alarm:
                self._in_force[len(self.raised)] = alarm
            else:
                raised = msgspec.structs.replace(raised, until=tick)
            self.raised.append(raised)

    def end(self) -> None:
        """Say that no more can be read."""
        self.health = msgspec.structs.replace(self.health, done=True)

    def _now(self, *, done: bool) -> Health:
        follower = self._follower
        if follower is None:
            return Health("", [], [], self._tick, done)
        monitor, standing = follower.monitor, follower.standing
        known, health = monitor.known.tolist(), monitor.health.tolist()
        return Health(
            standing.progress.line(),
            [alarm.line() for alarm in standing.alarms],
            [
                SensorHealth(sensor=name, known=known[at], health=round(health[at], 3))
                for at, name in enumerate(self._run_view.options.body.own)
            ],
            self._tick,
            done,
        )
