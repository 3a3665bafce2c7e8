"""Turns events, a sensor's new value each, into readings: a tick for each change.

What happens at the same time is one tick, unless a sensor changes twice. Between its
events a sensor reads what it read last. Events that change nothing are no ticks.
"""

from array import array

import numpy as np

from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.tables.readings import Readings, utc

_UNKNOWN = -1


class Events:
    """Takes events in any order; of those at the same time, the first comes first.

    Args:
        initial: What sensors read before their first event; None: that is unknown.
    """

    def __init__(self, initial: bool | None = None) -> None:
        self._initial = _UNKNOWN if initial is None else int(initial)
        self._sensors: dict[str, int] = {}
        self._times, self._who, self._said = array("d"), array("q"), array("b")

    def add(self, time: float, name: str, value: bool | None) -> None:
        """Take in an event.

        Args:
            time: Seconds since 1970.
            name: Of the sensor.
            value: What it reads from then on; None: that is unknown.
        """
        self._times.append(time)
        self._who.append(self._sensors.setdefault(name, len(self._sensors)))
        self._said.append(_UNKNOWN if value is None else int(value))

    def readings(self) -> Readings:
        """Return the readings; sensors are in the order of their names.

        Raises:
            InvalidValueError: A name cannot name a sensor.
        """
        names = sorted(self._sensors)
        growing = GrowingColumns(Sensorium(names))
        place = np.argsort([self._sensors[name] for name in names])
        now = np.full(len(names), self._initial, np.int8)
        changed: set[int] = set()
        moments: list[str] = []
        last = 0.0

        def tick() -> None:
            growing.append(now == 1, now != _UNKNOWN)
            moments.append(utc(last))
            changed.clear()

        order = np.argsort(np.frombuffer(self._times), kind="stable").tolist()
        for event in order:
            time, sensor = self._times[event], int(place[self._who[event]])
            if now[sensor] == self._said[event]:
                continue
            if changed and (time != last or sensor in changed):
                tick()
            now[sensor], last = self._said[event], time
            changed.add(sensor)
        if changed:
            tick()
        return Readings(growing.columns(), moments)
