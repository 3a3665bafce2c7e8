"""A recorded home: when each of its sensors was on."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.health.ten_minute_steps import Steps, steps_of
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.readings import Readings, seconds_of

_ZONE = "# zone:"
Spans = NDArray[np.float64]
"""``(n, 2)``, when a sensor came on and went off, seconds since 1970, in order."""


@dataclass(frozen=True)
class Home:
    """A recorded home; a sensor's number is its position in `sensors`."""

    sensors: tuple[str, ...]
    spans: tuple[Spans, ...]
    begin: float
    end: float
    zone: str = "UTC"

    def steps(self, begin: float, end: float) -> Steps:
        """Return its steps in a stretch of time."""
        near = (
            (float(on), float(off), sensor)
            for sensor, spans in enumerate(self.spans)
            for on, off in spans[(spans[:, 0] < end) & (spans[:, 1] >= begin)]
        )
        return steps_of(near, len(self.sensors), begin, end)

    def steps_of_one(self, sensor: int, begin: float, end: float) -> Steps:
        """Return the steps of one sensor alone, which has number 0 in them."""
        spans = self.spans[sensor]
        near = spans[(spans[:, 0] < end) & (spans[:, 1] >= begin)]
        return steps_of(((float(a), float(b), 0) for a, b in near), 1, begin, end)

    def events(self, begin: float, end: float) -> tuple[Spans, NDArray[np.int64]]:
        """Return the times at which sensors came on, in order, and their numbers."""
        times = np.concatenate([spans[:, 0] for spans in self.spans])
        who = np.repeat(np.arange(len(self.spans)), [len(s) for s in self.spans])
        near = (times >= begin) & (times < end)
        times, who = times[near], who[near]
        order = np.argsort(times, kind="stable")
        return times[order], who[order]

    def with_spans(self, changed: dict[int, Spans]) -> "Home":
        """Return the home with other spans of some sensors."""
        spans = tuple(changed.get(s, own) for s, own in enumerate(self.spans))
        return replace(self, spans=spans)


SUFFIXES = (".sensors", ".csv", ".parquet", ".db")
"""What the names of files with homes end with."""


def homes_in(folder: Path) -> list[Path]:
    """Return the files of the homes in a folder, by name.

    Raises:
        InvalidValueError: There is none.
    """
    paths = sorted(path for path in folder.glob("*") if path.suffix in SUFFIXES)
    if not paths:
        rule = f"must be a folder with files NAME{', NAME'.join(SUFFIXES)}"
        raise InvalidValueError("homes", rule, folder)
    return paths


def read_home(path: Path) -> Home:
    """Return the home in a file, in any form that `open_readings` reads.

    A file that ends with ``.sensors`` is one as published for research: a line has the
    start in seconds since 1970, the seconds that a sensor was on, and its number. The
    time zone may stand in a line above: ``# zone: Europe/Berlin``; it is UTC else.

    Raises:
        InvalidValueError: It cannot be read, or breaks a rule.
    """
    zone = "UTC"
    if path.suffix == ".sensors":
        first = path.read_text().partition("\n")[0]
        if first.startswith(_ZONE):
            zone = first.removeprefix(_ZONE).strip()
        rows = np.loadtxt(path, ndmin=2)
        numbers = np.unique(rows[:, 2].astype(int)).tolist()
        sensors = tuple(sorted(f"s{number}" for number in numbers))
        spans = [
            merged(np.column_stack([own[:, 0], own[:, 0] + own[:, 1]]))
            for own in (rows[rows[:, 2] == int(name[1:])] for name in sensors)
        ]
    else:
        readings = open_readings(str(path))
        sensors = tuple(readings.columns.sensorium.names)
        spans = spans_of(readings)
    used = [own for own in spans if len(own)]
    if not used:
        raise InvalidValueError(str(path), "must have a sensor that was on", "none")
    return Home(
        sensors,
        tuple(spans),
        min(float(own[0, 0]) for own in used),
        max(float(own[:, 1].max()) for own in used),
        zone,
    )


def spans_of(readings: Readings) -> list[Spans]:
    """Return when each sensor was on; while its reading is unknown, it was not.

    A sensor that is on at the end was on until then.
    """
    times, ticks = seconds_of(readings), readings.columns.ticks
    made = []
    for sensor in range(len(readings.columns.sensorium.names)):
        row = readings.columns.reading(sensor) & readings.columns.known(sensor)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row, [0]]).astype(np.int8)))
        made.append(times[np.minimum(edges, ticks - 1)].reshape(-1, 2))
    return made


def merged(spans: Spans) -> Spans:
    """Return spans in order, those that overlap as one."""
    ordered = spans[np.lexsort(spans.T[::-1])]
    if not len(ordered):
        return ordered.reshape(0, 2)
    reach = np.maximum.accumulate(ordered[:, 1])
    fresh = np.concatenate([[True], ordered[1:, 0] > reach[:-1]])
    last = np.concatenate([np.flatnonzero(fresh)[1:] - 1, [len(ordered) - 1]])
    return np.column_stack([ordered[fresh, 0], reach[last]])
