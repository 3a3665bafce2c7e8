"""Which sensors were at fault in a run, and when: anomalies and alarms in one list.

Anomalies near one another with the same first culprit are one finding. It is over once
a reading keeps the broken rule again. If the rule stays broken without an anomaly, that
was learned as normal.
"""

from bisect import bisect_left
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap.apps.viewer.api import MOST_FINDINGS, AnomalyView, Finding, FindingList
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.apps.viewer.time_series import Raster, TimeSeries
from neurosnap.errors import MessageError, ShapeError
from neurosnap.health.alarm import Alarm, lasted
from neurosnap.health.alarm_budget import NEVER
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recorded_readings import own_readings
from neurosnap.system.local_time import dated

if TYPE_CHECKING:
    from neurosnap.health.follower import Follower

NEAR = 10
"""Ticks between two anomalies of one finding, at most."""
_BEFORE, _WIDE = 20, 60
"""Ticks before a finding begins whose readings are shown, and ticks in all."""


class Spells:
    """The findings by anomalies, as they are told tick by tick."""

    def __init__(self) -> None:
        self.listed: list[Finding] = []
        """In the order in which they began."""
        self._open: set[int] = set()  # places of those that go on

    def take(
        self, tick: int, told: AnomalyView | None, read: NDArray[np.bool_]
    ) -> None:
        """Take in a tick, after those before: its anomaly, and the literals read."""
        if told is not None:
            self._tell(tick, told)
        for place in sorted(self._open):
            spell = self.listed[place]
            if spell.last == tick:
                continue
            source, target = spell.rule or (0, 0)
            if spell.rule is None or read[source ^ 1] or read[target]:
                self.listed[place] = replace(spell, state="over")
            elif read[source] and read[target ^ 1]:
                self.listed[place] = replace(spell, state="learned as normal")
            else:
                continue  # one of the two was not read
            self._open.remove(place)

    def _tell(self, tick: int, told: AnomalyView) -> None:
        """Take in an anomaly: the last finding goes on, or another begins."""
        read = [] if told.rule is None else [told.rule[0], told.rule[1] ^ 1]
        sensor = [*told.culprits, *told.others, *(one >> 1 for one in read), 0][0]
        read.sort(key=lambda literal: literal >> 1 != sensor)
        last = self.listed[-1] if self.listed else None
        if last and last.sensors[0] == sensor and tick - (last.last or 0) <= NEAR:
            self.listed[-1] = replace(last, last=tick, rule=told.rule, state="now")
        else:
            said = ["read on, expected off", "read off, expected on", "may be wrong"]
            begun = Finding(
                sensors=list(dict.fromkeys((sensor, *(one >> 1 for one in read)))),
                tick=tick,
                first=tick,
                last=tick,
                what=said[read[0] & 1 if read and read[0] >> 1 == sensor else 2],
                sentence=told.sentence,
                rule=told.rule,
            )
            self.listed.append(begun)
        self._open.add(len(self.listed) - 1)


class RunFindings:
    """The findings of a recorded run, as far as it was read.

    Args:
        options: The run's.
        series: Says what sensors that were grown are called.
        raster: Has the readings.
    """

    def __init__(self, options: RunOptions, series: TimeSeries, raster: Raster) -> None:
        self._options = options
        self._series = series
        self._raster = raster
        self._spells = Spells()
        self.alarms: list[Finding] = []
        """Those that are alarms, in the order in which they were raised."""
        self.anomalies: list[int] = []
        """The ticks with an anomaly that is told, ascending."""
        self.times: dict[int, float] = {}
        """When each tick was observed, in seconds since 1970."""
        self._since: dict[tuple[int, int], float] = {}  # of each alarm, its evidence
        self._follower: Follower | None = None
        if options.alarms != NEVER:
            self._follower = options.follower()

    def read(self, ticks: Ticks, first: int, last: int) -> None:
        """Take in the messages of the ticks that follow those read before.

        To learn anew what is usual for a home's sensors takes seconds, sometimes.
        """
        for tick in range(first, last + 1):
            if (moment := ticks.moment(tick)) is not None:
                self.times[tick] = moment
            told = None
            with suppress(MessageError):  # it is none
                told = ticks.anomaly(tick, self._series.births.body)
            if told is not None:
                self.anomalies.append(tick)
            self._spells.take(tick, told, ticks.literals(tick))
            with suppress(ShapeError):  # it is of other sensors
                self._judge(ticks, tick)

    def _judge(self, ticks: Ticks, tick: int) -> None:
        """Follow the health of the home's own sensors."""
        observation, body = ticks.observations.get(tick), self._options.body
        if self._follower is None or observation is None:
            return
        read = own_readings(observation, ticks.sent[tick], body)
        at, on, known, begins, said = read
        for news in self._follower.observe(on, known, at, begins=begins, said=said):
            sensor = body.own.index(news.sensor)
            for place, was in enumerate(self.alarms):
                if was.sensors[0] == sensor and was.last is None:
                    self.alarms[place] = replace(was, last=tick - 1, state="over")
            if news.alarm is not None:
                self.alarms.append(self._raised(tick, sensor, news.alarm))

    def _raised(self, tick: int, sensor: int, alarm: Alarm) -> Finding:
        """Return the finding of an alarm, which begins with the evidence for it."""
        others = [self._options.body.own.index(other) for other in alarm.others]
        since = self._since[sensor, tick] = alarm.since
        return Finding(
            sensors=[sensor, *others],
            tick=tick,
            first=[*self.times, tick][bisect_left([*self.times.values()], since)],
            last=None,
            what=alarm.kind,
            sentence=alarm.line(),
            alarm=True,
        )

    def listed(self) -> FindingList:
        """Return them, the newest first."""
        every = [*self._spells.listed, *self.alarms]
        newest = sorted(every, key=lambda one: one.tick, reverse=True)
        follower = self._follower
        return FindingList(
            findings=[self._timed(each) for each in newest[:MOST_FINDINGS]],
            left_out=max(0, len(newest) - MOST_FINDINGS),
            looked=self._options.watch or follower is not None,
            progress="" if follower is None else follower.standing.progress.line(),
        )

    def _timed(self, finding: Finding) -> Finding:
        """Return a finding with its times, and the readings around its beginning."""
        first, zone, times = finding.first, self._options.zone, self.times
        began = self._since.get((finding.sensors[0], finding.tick), times.get(first))
        ended = times.get((finding.last or 0) + 1)
        count = (finding.last or 0) + 1 - first
        words = f"{count} tick{'' if count == 1 else 's'}"
        if began is not None and ended is not None and ended - began >= 1:
            words += f", {lasted(ended - began)}"
        start = max(1, first - _BEFORE)
        return replace(
            finding,
            began="" if began is None else dated(began, zone),
            lasted="" if finding.state == "now" else words,
            around=[
                self._raster.part(start, start + _WIDE - 1, _WIDE, sensor, 1)
                for sensor in finding.sensors
            ],
        )
