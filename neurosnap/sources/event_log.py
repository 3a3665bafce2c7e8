"""Turns a log of events, each a sensor's new value, into readings at ticks.

What happens at the same time is one tick, unless a sensor changes twice. Between its
events a sensor reads what it read last. Events that change nothing are no ticks.

A log of events is a table with time, sensor and value. The header says which column is
which, in any order; Home Assistant's own history export calls them ``last_changed``,
``entity_id`` and ``state``.
"""

import math
from array import array
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.csv_cells_and_formulas import TableFile
from neurosnap.sources.cuts import with_cuts
from neurosnap.sources.meaning import Numbers, Reader, refused
from neurosnap.sources.readings import Readings, parse_time, utc
from neurosnap.sources.wanted import Wanted

_UNKNOWN = -1


class Events:
    """Collects events in any order, and makes readings of them.

    What a sensor reads before its first event is unknown.
    """

    def __init__(self) -> None:
        self._readers: list[Reader] = []
        self._sensors: dict[str, int] = {}
        self._times, self._who, self._said = array("d"), array("q"), array("b")
        self._numbers = array("f")  # as `Numbers` packs them

    def read(
        self, time: float, reader: Reader, text: str, where: str, name: str
    ) -> None:
        """Add an event, in seconds since 1970, by what the data say of it.

        Raises:
            InvalidValueError: They say neither on nor off.
        """
        try:
            value = reader.read(text)
        except ValueError as error:
            raise refused(where, name, error, text) from None
        who = self._sensors.setdefault(reader.name, len(self._sensors))
        if who == len(self._readers):
            self._readers.append(reader)
        self._times.append(time)
        self._who.append(who)
        self._said.append(_UNKNOWN if value is None else value)
        self._numbers.append(reader.number)

    def readings(self) -> Readings:
        """Return the readings; sensors are in the order of their names.

        Raises:
            InvalidValueError: A name cannot name a sensor.
        """
        names = sorted(self._sensors)
        readers = [self._readers[self._sensors[name]] for name in names]
        growing, numbers = GrowingColumns(Sensorium(names)), Numbers(readers)
        place = np.argsort([self._sensors[name] for name in names])
        now = np.full(len(names), _UNKNOWN, np.int8)
        changed: set[int] = set()
        moments: list[str] = []
        said: list[bytes] = []
        last = 0.0

        def tick() -> None:
            known = now != _UNKNOWN
            growing.append(now == 1, known)
            moments.append(utc(last))
            if packed := numbers.packed(known):
                said.append(packed)
            changed.clear()

        order = np.argsort(np.frombuffer(self._times), kind="stable").tolist()
        for event in order:
            time, sensor = self._times[event], int(place[self._who[event]])
            same = now[sensor] == self._said[event]
            if changed and (time != last or (sensor in changed and not same)):
                tick()
            readers[sensor].number = self._numbers[event]
            if same:
                continue
            now[sensor], last = self._said[event], time
            changed.add(sensor)
        if changed:
            tick()
        return Readings(growing.columns(), moments, said=said)


_ROLES = {
    "time": ("time", "timestamp", "last_changed", "last_updated"),
    "sensor": ("sensor", "entity_id"),
    "value": ("value", "state"),
}


def roles(header: list[str], time: str | None = None) -> tuple[int, int, int] | None:
    """Return which columns hold time, sensor and value; None if it is no log.

    `time` is the name of the column with the time, if it was told.
    """
    names = [name.casefold() for name in header]
    found = []
    for role, words in _ROLES.items():
        if role == "time" and time is not None:
            words = (time.casefold(),)
        places = [names.index(word) for word in words if word in names]
        if not places:
            return None
        found.append(places[0])
    when, who, what = found
    return when, who, what


def log_settled(
    file: TableFile, places: tuple[int, int, int], wanted: Wanted
) -> Wanted:
    """Return what is wanted of a log with its cuts; see `read_event_log`."""
    _, who, what = places
    wanted = wanted.parsed()

    def values() -> Iterator[tuple[str, str, bool]]:
        last = math.inf
        if wanted.learned < 1:
            last = wanted.learned * sum(1 for _ in file.lines())
        for count, (line, data) in enumerate(file.lines()):
            cells = file.cells(line, data)
            if wanted.takes(cells[who]):
                yield cells[who], cells[what], count < last

    return with_cuts(wanted, values())


def read_event_log(
    file: TableFile, places: tuple[int, int, int], wanted: Wanted
) -> Readings:
    """Return the wanted readings of a log, with `places` as `roles` returns them.

    Raises:
        InvalidValueError: A line breaks a rule.
    """
    wanted = wanted.parsed()
    if wanted.cuts is None:
        # For speed: most logs say on and off alone, and then there is nothing to cut.
        with suppress(InvalidValueError):
            return _read(file, places, replace(wanted, cuts={}))
    return _read(file, places, log_settled(file, places, wanted))


def _read(file: TableFile, places: tuple[int, int, int], wanted: Wanted) -> Readings:
    events = Events()
    readers: dict[str, list[Reader]] = {}
    when, who, what = places
    for line, data in file.lines():
        cells = file.cells(line, data)
        name = cells[who]
        if name not in readers:
            readers[name] = wanted.readers(name)
        if not readers[name]:
            continue
        where = f"{file.path}:{line}"
        time = parse_time(cells[when], f"{where}: {file.header[when]}")
        for reader in readers[name]:
            events.read(time, reader, cells[what], where, name)
    wanted.check(list(readers), file.path)
    return replace(events.readings(), wanted=wanted)
