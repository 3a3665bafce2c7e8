"""Homes as they are published for research: when each sensor was on, and how long.

A line has the start in seconds since 1970, the seconds that the sensor was on, and its
number: ``1203898814 163 24``. Before and after that it is off.
"""

from pathlib import Path

from neurosnap.errors import InvalidValueError
from neurosnap.sources.tables.events import Events
from neurosnap.sources.tables.meaning import Wanted
from neurosnap.sources.tables.readings import Readings


def read_home_intervals(path: str, wanted: Wanted) -> Readings:
    """Return the readings of a home; its sensors are called ``s`` and their number.

    Args:
        path: Where the file is.
        wanted: Which sensors to read.

    Raises:
        InvalidValueError: It cannot be read, or a line breaks a rule.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InvalidValueError(
            path, "must be UTF-8 text", error.object[:40]
        ) from error
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
        raise InvalidValueError("source", rule, path) from error
    spans: dict[str, list[tuple[float, float]]] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            start, seconds, sensor = line.split()
            begin, end = float(start), float(start) + float(seconds)
            name = f"s{int(sensor)}"
        except ValueError:
            rule = "must be a start and a duration in seconds, and the sensor's number"
            raise InvalidValueError(f"{path}:{number}", rule, line) from None
        if not begin <= end < float("inf"):
            rule = "must not end before it starts"
            raise InvalidValueError(f"{path}:{number}", rule, line)
        spans.setdefault(name, []).append((begin, end))
    wanted.check(list(spans), path)
    events = Events(initial=False)
    for name, own in spans.items():
        if wanted.takes(name):
            for begin, end in _merged(own):
                events.add(begin, name, value=True)
                events.add(end, name, value=False)
    return events.readings()


def _merged(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return spans in order, those that overlap as one."""
    merged: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if merged and begin < merged[-1][1]:
            merged[-1] = merged[-1][0], max(end, merged[-1][1])
        else:
            merged.append((begin, end))
    return merged
