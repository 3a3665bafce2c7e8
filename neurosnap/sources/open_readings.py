"""Opens a file of readings in any supported format, as a table or as a source."""

from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.poc.order.literal_sets import from_words
from neurosnap.sensorium import Sensorium
from neurosnap.sources import home_assistant_db
from neurosnap.sources.bag_records import MAGIC, is_bag
from neurosnap.sources.csv_cells_and_formulas import CsvFile, TableFile, TableRows
from neurosnap.sources.event_log import log_settled, read_event_log, roles
from neurosnap.sources.mcap_file import read_mcap
from neurosnap.sources.protocol import Observed
from neurosnap.sources.readings import Readings, is_time, parse_time
from neurosnap.sources.wanted import Wanted
from neurosnap.system.distribution import must_have
from neurosnap.system.durable import opened_file

_PARQUET = b"PAR1"
_ROWS = 4096  # of a Parquet file that are read at a time


def open_readings(path: str, wanted: Wanted | None = None) -> Readings:
    """Return the readings in a file.

    What a file is, is told by its first bytes: a database of Home Assistant, messages
    (MCAP), Parquet, else CSV. A Parquet or CSV file is a log of events if its header
    has the columns of one, or else a table.

    Args:
        path: Where it is.
        wanted: Which sensors to read, and how; if None, all there are.

    Raises:
        MissingExtraError: pyarrow is needed, and not installed.
        InvalidValueError: The file cannot be read, or breaks a rule; the text says
            where.
    """
    wanted = wanted or Wanted()
    if is_bag(path):
        readings = read_mcap(path, wanted)
    elif first_bytes(path).startswith(home_assistant_db.MAGIC):
        readings = home_assistant_db.read_home_assistant(path, wanted)
    else:
        readings = _read_table(*_table(path, wanted))
    if not readings.columns.ticks:
        raise InvalidValueError(path, "must hold readings", "none")
    return readings


def settled(path: str, wanted: Wanted) -> Wanted:
    """Return what is wanted with its cuts; of a table or log no readings are made.

    Raises:
        NeurosnapError: As `open_readings`.
    """
    if not (is_bag(path) or first_bytes(path).startswith(home_assistant_db.MAGIC)):
        file, wanted = _table(path, wanted)
        if places := roles(file.header, wanted.time):
            return log_settled(file, places, wanted)
        return TableRows(file, wanted).wanted
    return open_readings(path, wanted).wanted


def first_bytes(path: str) -> bytes:
    """Return what a file begins with.

    Raises:
        InvalidValueError: It cannot be read.
    """
    try:
        with opened_file(path) as file:
            return file.read(16)
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
        raise InvalidValueError("source", rule, path) from error


def _table(path: str, wanted: Wanted) -> tuple[TableFile, Wanted]:
    """Return a file of Parquet or CSV, and what is wanted of it."""
    beginning = first_bytes(path)
    if beginning.startswith(MAGIC):
        rule = "must not be a run's own recording: resume, replay and learn take it"
        raise InvalidValueError("source", rule, path)
    if not beginning.startswith(_PARQUET):
        return CsvFile(path), wanted
    parquet = _ParquetFile(path)
    if wanted.time is None and parquet.time is not None:
        wanted = replace(wanted, time=parquet.time)
    return parquet, wanted


def _read_table(file: TableFile, wanted: Wanted) -> Readings:
    if places := roles(file.header, wanted.time):
        return read_event_log(file, places, wanted)
    rows = TableRows(file, wanted)
    growing, times = GrowingColumns(Sensorium(rows.sensors)), list[str]()
    said: list[bytes] = []
    for row in rows.rows():
        growing.append(row.bits, row.known)
        times.append(row.time)
        if row.said:
            said.append(row.said)
    timed = times if rows.timed else None
    return Readings(growing.columns(), timed, said=said, wanted=rows.wanted)


class FileSource:
    """A source that gives the readings of a file; actions change nothing.

    A tick at which nothing is known is left out.

    Args:
        path: Where the file is.
        wanted: As in `open_readings`.

    Raises:
        MissingExtraError: As `open_readings`.
        InvalidValueError: As `open_readings`, or nothing in it is ever known.
    """

    live: bool = False
    discrete: bool = False

    def __init__(self, path: str, wanted: Wanted | None = None) -> None:
        readings = open_readings(path, wanted)
        self._columns, self._said = readings.columns, readings.said
        self.sensors: tuple[str, ...] = self._columns.sensorium.names
        self.orders: tuple[int, ...] = (0,) * len(self.sensors)
        self.actions: tuple[str, ...] = ()
        known = np.bitwise_or.reduce(self._columns.on | self._columns.off)
        self._ticks = np.flatnonzero(from_words(known, self._columns.ticks))
        self.length: int | None = len(self._ticks)
        if not self.length:
            raise InvalidValueError(path, "must hold readings", "none that is known")
        self._next = 0
        # A clock that was put back, or says nothing, stands until it is ahead again.
        times = readings.times or ()
        first = next(filter(None, times), "")
        self.undated = "" if not first or is_time(first) else first  # it is no time
        times = () if self.undated else times
        moments = [parse_time(text, "time") if text else 0.0 for text in times]
        self._at = np.maximum.accumulate(moments).tolist()
        self.zone = readings.zone if any(self._at) else None  # None: nothing is dated
        self.times = np.array(self._at)

    def first(self) -> Observed | None:
        """Go to the beginning and return the first observation."""
        self._next = 0
        return self.step(-1)

    def step(self, action: int) -> Observed | None:
        """Return the next observation, or None after the last; `action` is ignored."""
        if self._next >= len(self._ticks):
            return None
        row = int(self._ticks[self._next])
        bits, known = self._columns.row(row)
        self._next += 1
        at = self._at[row] if self._at else 0
        sure = None if known.all() else known
        said = self._said[row] if self._said else b""
        return Observed(bits, sure, self._next == 1, at=at, said=said)

    def close(self) -> None:
        """Do nothing: the file is closed already."""


class _ParquetFile:
    """A Parquet file: columns of booleans, numbers or words; what is missing is empty.

    Attributes:
        time: The first column of dates, which holds the time; None if there is none.
            The others are left out.

    Raises:
        MissingExtraError: pyarrow is not installed.
        InvalidValueError: It cannot be read.
    """

    delimiter = ""

    def __init__(self, path: str) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError as error:
            rule = must_have("pyarrow", "export")
            raise MissingExtraError(f"{path}: {rule}") from error
        self.path = path
        self._failures = (pa.ArrowException, OSError)
        try:
            self._file: Any = pq.ParquetFile(path)
        except self._failures as error:
            raise self._wrong(error) from error
        schema = self._file.schema_arrow
        dates = [each.name for each in schema if pa.types.is_temporal(each.type)]
        self.time: str | None = next(iter(dates), None)
        self.header = [name for name in schema.names if name not in dates[1:]]

    def lines(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the number of each row, from 1, and its cells.

        Raises:
            InvalidValueError: While iterating: it cannot be read.
        """
        done = 0
        try:
            for batch in self._file.iter_batches(_ROWS, columns=self.header):
                columns = [batch.column(name).to_pylist() for name in self.header]
                for cells in zip(*columns, strict=True):
                    done += 1
                    yield done, [_text(cell) for cell in cells]
        except self._failures as error:
            raise self._wrong(error) from error

    def cells(self, line: int, data: bytes | list[str]) -> list[str]:
        """Return the cells of a row, which are there already."""
        return [*map(str, data)]

    def _wrong(self, error: Exception) -> InvalidValueError:
        return InvalidValueError(self.path, "must be a Parquet file", str(error))


def _text(value: object) -> str:
    """Return a cell as CSV would have it; dates without a zone are in UTC."""
    if value is None or isinstance(value, bool):
        return "" if value is None else str(int(value))
    if isinstance(value, datetime):
        zoned = value if value.tzinfo else value.replace(tzinfo=UTC)
        return zoned.astimezone(UTC).isoformat(" ")
    return str(value)
