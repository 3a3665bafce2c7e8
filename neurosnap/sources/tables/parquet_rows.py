"""Readings in a Parquet file: a column a sensor, a row a tick; or a log of events."""

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import numpy as np

from neurosnap.errors import InvalidValueError, MissingExtraError, within
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.meaning import Reader, Wanted
from neurosnap.sources.tables.csv_file import OnProgress
from neurosnap.sources.tables.events import Events, roles, seconds
from neurosnap.sources.tables.readings import Readings
from neurosnap.system.distribution import must_have

MAGIC = b"PAR1"
_ROWS = 4096


def read_parquet(
    path: str, wanted: Wanted, on_progress: OnProgress | None = None
) -> Readings:
    """Return the readings of a Parquet file.

    Columns hold booleans, 0 and 1, or words; what is missing is unknown. A column of
    dates holds the time, and so does a first one called ``time``.

    Args:
        path: Where the file is.
        wanted: Which sensors to read.
        on_progress: Told how many rows are read.

    Raises:
        MissingExtraError: pyarrow is not installed.
        InvalidValueError: It cannot be read, or breaks a rule.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise MissingExtraError(f"{path}: {must_have('pyarrow', 'export')}") from error
    try:
        with pq.ParquetFile(path) as file:
            names = list(file.schema_arrow.names)
            dates = [
                field.name
                for field in file.schema_arrow
                if pa.types.is_temporal(field.type)
            ]
            batches = _batches(file, on_progress)
            if places := roles(names, wanted.time):
                return _events(path, batches, places, wanted)
            return _table(path, names, dates, batches, wanted)
    except (pa.ArrowException, OSError) as error:
        raise InvalidValueError(path, "must be a Parquet file", str(error)) from error


def _batches(file: Any, on_progress: OnProgress | None) -> Iterator[Any]:  # noqa: ANN401
    done, total = 0, file.metadata.num_rows
    for batch in file.iter_batches(_ROWS):
        yield batch
        done += batch.num_rows
        if on_progress is not None:
            on_progress(done, total)


def _table(
    path: str,
    names: list[str],
    dates: list[str],
    batches: Iterator[Any],
    wanted: Wanted,
) -> Readings:
    """Read a column a sensor."""
    time = wanted.time
    if time is None:
        time = next(iter(dates), "time" if names[:1] == ["time"] else None)
    elif time not in names:
        raise InvalidValueError(path, "must have this column", time)
    apart = {*dates, time}
    sensed = [name for name in names if name not in apart]
    wanted.check(sensed, path)
    readers = [(name, reader) for name in sensed for reader in wanted.readers(name)]
    try:
        sensorium = Sensorium(reader.name for _, reader in readers)
    except InvalidValueError as error:
        raise within(path, error) from error
    if not readers:
        raise InvalidValueError(path, "must have columns of sensors", names)
    growing, times = GrowingColumns(sensorium), list[str]()
    for batch in batches:
        read = [
            _column(path, growing.ticks, name, reader, batch.column(name).to_pylist())
            for name, reader in readers
        ]
        values = np.array(read, np.int8).reshape(len(readers), batch.num_rows).T
        growing.extend(values == 1, values >= 0)
        if time is not None:
            times += [_moment(value) for value in batch.column(time).to_pylist()]
    return Readings(growing.columns(), None if time is None else times)


def _column(
    path: str, start: int, name: str, reader: Reader, values: list[object]
) -> list[int]:
    """Return what a column says: 1, 0, or -1 for unknown."""
    said = []
    for row, value in enumerate(values, start=start + 1):
        if reader.comparison is None and isinstance(value, bool):
            said.append(int(value))
        else:
            found = _value(reader, value, f"{path}: {name}, row {row}")
            said.append(-1 if found is None else int(found))
    return said


def _events(
    path: str, batches: Iterator[Any], places: tuple[int, int, int], wanted: Wanted
) -> Readings:
    """Read a log."""
    events, readers, row = Events(), dict[str, list[Reader]](), 0
    for batch in batches:
        columns = [batch.column(place).to_pylist() for place in places]
        for when, who, what in zip(*columns, strict=True):
            row += 1
            name = str(who)
            if name not in readers:
                readers[name] = wanted.readers(name)
            for reader in readers[name]:
                where = f"{path}: row {row}"
                time = seconds(_moment(when), where)
                value = _value(reader, what, f"{where}, {name}")
                events.add(time, reader.name, value)
    wanted.check(list(readers), path)
    return events.readings()


def _value(reader: Reader, value: object, where: str) -> bool | None:
    try:
        return reader.read("" if value is None else str(value))
    except ValueError as error:
        raise InvalidValueError(where, str(error), value) from None


def _moment(value: object) -> str:
    """Return a moment as text; dates without a zone are in UTC."""
    if isinstance(value, datetime):
        zoned = value if value.tzinfo else value.replace(tzinfo=UTC)
        return zoned.astimezone(UTC).isoformat(" ")
    return "" if value is None else str(value)
