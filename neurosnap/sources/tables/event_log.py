"""A log of events in a CSV file: time, sensor, value.

The header says which column is which, in any order; Home Assistant's own history export
calls them ``last_changed``, ``entity_id`` and ``state``.
"""

from datetime import UTC, datetime

from neurosnap.errors import InvalidValueError
from neurosnap.sources.tables.csv_file import CsvFile, OnProgress
from neurosnap.sources.tables.events import Events
from neurosnap.sources.tables.meaning import Reader, Wanted
from neurosnap.sources.tables.readings import Readings

_ROLES = {
    "time": ("time", "timestamp", "last_changed", "last_updated"),
    "sensor": ("sensor", "entity_id"),
    "value": ("value", "state"),
}
_MILLISECONDS = 1e11
"""Numbers from here on count these: in seconds it would be the year 5138."""


def roles(header: list[str], time: str | None = None) -> tuple[int, int, int] | None:
    """Return which columns hold time, sensor and value; None: it is no log.

    Args:
        header: The names of the columns.
        time: The name of the column with the time, if it was told.
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


def read_event_log(
    file: CsvFile,
    places: tuple[int, int, int],
    wanted: Wanted,
    on_progress: OnProgress | None = None,
) -> Readings:
    """Return the readings of a log.

    Args:
        file: The log.
        places: As `roles` returns them.
        wanted: Which sensors to read.
        on_progress: Told how many bytes are read.

    Raises:
        InvalidValueError: A line breaks a rule.
    """
    events = Events()
    readers: dict[str, list[Reader]] = {}
    when, who, what = places
    for line, data in file.lines(on_progress):
        cells = file.cells(line, data)
        name = cells[who]
        if name not in readers:
            readers[name] = wanted.readers(name)
        if not readers[name]:
            continue
        time = seconds(cells[when], f"{file.path}:{line}: {file.header[when]}")
        for reader in readers[name]:
            try:
                value = reader.read(cells[what])
            except ValueError as error:
                where = f"{file.path}:{line}: {name}"
                raise InvalidValueError(where, str(error), cells[what]) from None
            events.add(time, reader.name, value)
    wanted.check(list(readers), file.path)
    return events.readings()


def seconds(text: str, where: str) -> float:
    """Return a moment in seconds since 1970; without a zone it is one of UTC."""
    try:
        number = float(text)
    except ValueError:
        pass
    else:
        return number / 1000 if abs(number) >= _MILLISECONDS else number
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        rule = "must be seconds since 1970, or a date such as 2026-07-01 12:00:00"
        raise InvalidValueError(where, rule, text) from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
