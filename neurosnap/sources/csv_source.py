"""A CSV file as a source of observations, checked whole before the start."""

from collections.abc import Iterator

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.meaning import Wanted
from neurosnap.sources.protocol import Observed
from neurosnap.sources.tables.csv_file import CsvFile, TableRow, TableRows


class CsvSource:
    """The rows of a CSV file of readings, one after the other; actions change nothing.

    What the file may look like is said in `neurosnap.sources.tables`. A row in which
    nothing is known is left out. The file is read twice, once to check it and once to
    give it out, and never held in memory.

    Args:
        path: Where it is.

    Raises:
        InvalidValueError: The file cannot be read or breaks a rule.
    """

    live: bool = False

    def __init__(self, path: str) -> None:
        self._path = path
        self._rows: Iterator[TableRow] | None = None
        rows = TableRows(CsvFile(path), Wanted())
        self.sensors = rows.sensors
        self.orders: tuple[int, ...] = (0,) * len(self.sensors)
        self.actions: tuple[str, ...] = ()
        self.discrete: bool = False
        self.length: int | None = sum(1 for _ in _known_rows(rows))
        if self.length == 0:
            raise InvalidValueError(path, "must have rows below its header", 0)
        self._left = 0

    def first(self) -> Observed:
        """Go to the top of the file and return the first reading.

        Raises:
            InvalidValueError: The file has changed since it was opened.
        """
        rows = TableRows(CsvFile(self._path), Wanted())
        if rows.sensors != self.sensors:
            raise self._changed()
        self._rows = _known_rows(rows)
        self._left = self.length or 0
        return self._next(self._rows, begins=True)

    def step(self, action: int) -> Observed | None:
        """Return the next reading, or None below the last; `action` is ignored.

        Raises:
            InvalidValueError: The file has changed since it was opened.
            NeurosnapError: `first` was not called, or the source is closed.
        """
        if self._rows is None:
            raise NeurosnapError(f"{self._path}: step needs a call of first before")
        # Not until the file ends: rows that were added meanwhile do not count.
        return self._next(self._rows) if self._left else None

    def close(self) -> None:
        """Close the file."""
        self._rows = None

    def _next(self, rows: Iterator[TableRow], *, begins: bool = False) -> Observed:
        row = next(rows, None)
        if row is None:
            raise self._changed()
        self._left -= 1
        return Observed(row.bits, row.known, begins)

    def _changed(self) -> InvalidValueError:
        rule = f"must keep its {self.length} rows while in use"
        return InvalidValueError(self._path, rule, "other contents")


def _known_rows(rows: TableRows) -> Iterator[TableRow]:
    """Yield the rows in which something is known."""
    return (row for row in rows.rows() if row.known is None or row.known.any())
