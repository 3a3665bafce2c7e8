"""Opens a file of readings, of whatever kind it is."""

from pathlib import Path

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.meaning import Wanted
from neurosnap.sources.tables import home_assistant_db, parquet_rows
from neurosnap.sources.tables.csv_file import CsvFile, CsvRows, OnProgress
from neurosnap.sources.tables.events import read_event_log, read_home_intervals, roles
from neurosnap.sources.tables.readings import Readings

_INTERVALS = ".sensors"


def open_readings(
    path: str, wanted: Wanted | None = None, on_progress: OnProgress | None = None
) -> Readings:
    """Return the readings in a file.

    What a file is, is told by its first bytes: a database of Home Assistant, Parquet,
    else text. Text whose name ends with ``.sensors`` holds the intervals of a home; a
    CSV file is a log of events if its header has the columns of one, or else a table.

    Args:
        path: Where it is.
        wanted: Which sensors to read, and how; None: what there is.
        on_progress: Told how much is read, and of how much.

    Raises:
        MissingExtraError: pyarrow is needed, and not installed.
        InvalidValueError: The file cannot be read, or breaks a rule; the text says
            where.
    """
    wanted = wanted or Wanted()
    beginning = first_bytes(path)
    if beginning.startswith(home_assistant_db.MAGIC):
        readings = home_assistant_db.read_home_assistant(path, wanted, on_progress)
    elif beginning.startswith(parquet_rows.MAGIC):
        readings = parquet_rows.read_parquet(path, wanted, on_progress)
    elif path.lower().endswith(_INTERVALS):
        readings = read_home_intervals(path, wanted)
    else:
        readings = _read_csv(path, wanted, on_progress)
    if not readings.columns.ticks:
        raise InvalidValueError(path, "must hold readings", "none")
    return readings


def first_bytes(path: str) -> bytes:
    """Return what a file begins with.

    Raises:
        InvalidValueError: It cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(16)
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
        raise InvalidValueError("source", rule, path) from error


def _read_csv(path: str, wanted: Wanted, on_progress: OnProgress | None) -> Readings:
    file = CsvFile(path)
    if places := roles(file.header, wanted.time):
        return read_event_log(file, places, wanted, on_progress)
    rows = CsvRows(file, wanted)
    growing, times = GrowingColumns(Sensorium(rows.sensors)), list[str]()
    for row in rows.rows(on_progress):
        growing.append(row.bits, row.known)
        times.append(row.time)
    return Readings(growing.columns(), times if rows.timed else None)
