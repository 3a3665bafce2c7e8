"""A CSV file as a source of observations, checked whole before the start."""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, NeurosnapError, ShapeError, within
from neurosnap.sensorium import Sensorium
from neurosnap.system.csv_text import as_written

_BITS = frozenset({"0", "1"})


class CsvSource:
    """The rows of a CSV file of readings, one after the other; actions change nothing.

    The first row names the sensors, every other holds a 0 or 1 for each. A first column
    named ``time`` is left out, and so is an apostrophe that keeps a spreadsheet from
    running a name as a formula (`neurosnap.system.csv_text`). The file is UTF-8, with
    or without a byte order mark; white space around a cell and blank lines at the end
    do not count. It is read twice, once to check it and once to give it out, and never
    held in memory.

    Args:
        path: Where it is.

    Raises:
        InvalidValueError: The file cannot be read or breaks a rule.
    """

    known: NDArray[np.bool_] | None = None
    live: bool = False

    def __init__(self, path: str) -> None:
        self._path = path
        self._readings: Iterator[NDArray[np.bool_]] | None = None
        self.sensors, readings = _parse(path)
        self.orders: tuple[int, ...] = (0,) * len(self.sensors)
        self.actions: tuple[str, ...] = ()
        self.exclusive: bool = True
        self.discrete: bool = False
        self.length: int | None = sum(1 for _ in readings)
        if self.length == 0:
            raise InvalidValueError(path, "must have rows below its header", 0)
        self.begins: bool = False
        self.cut: bool = False
        self._left = 0

    def first(self) -> NDArray[np.bool_]:
        """Go to the top of the file and return the first reading.

        Raises:
            InvalidValueError: The file has changed since it was opened.
        """
        sensors, self._readings = _parse(self._path)
        if sensors != self.sensors:
            raise self._changed()
        self._left = self.length or 0
        self.begins = True
        return self._next(self._readings)

    def step(self, action: int) -> NDArray[np.bool_] | None:
        """Return the next reading, or None below the last; `action` is ignored.

        Raises:
            InvalidValueError: The file has changed since it was opened.
            NeurosnapError: `first` was not called, or the source is closed.
        """
        if self._readings is None:
            raise NeurosnapError(f"{self._path}: step needs a call of first before")
        self.begins = False
        # Not until the file ends: rows that were added meanwhile are nobody's.
        return self._next(self._readings) if self._left else None

    def close(self) -> None:
        """Close the file."""
        self._readings = None

    def _next(self, readings: Iterator[NDArray[np.bool_]]) -> NDArray[np.bool_]:
        reading = next(readings, None)
        if reading is None:
            raise self._changed()
        self._left -= 1
        return reading

    def _changed(self) -> InvalidValueError:
        rule = f"must keep its {self.length} rows while in use"
        return InvalidValueError(self._path, rule, "other contents")


def _parse(path: str) -> tuple[tuple[str, ...], Iterator[NDArray[np.bool_]]]:
    """Return the sensors' names and, lazily, the readings of a CSV file.

    Raises:
        InvalidValueError: The header breaks a rule; the iterator raises it for rows.
    """
    lines = _lines(path)
    _, header = next(lines, (1, []))
    if not header:
        raise InvalidValueError(path, "must have a header of sensor names", "no text")
    if "\t" in header[0]:  # no name may have one
        rule = "must have commas between the names of sensors, not tabs"
        raise InvalidValueError(f"{path}:1", rule, header[0])
    skipped = 1 if header[0] == "time" else 0
    names = [as_written(name) for name in header[skipped:]]
    if not names or _BITS.issuperset(names):
        # Readings without a header would lose their first row unnoticed.
        raise InvalidValueError(f"{path}:1", "must be a header of sensor names", header)
    try:
        sensors = Sensorium(names).names
    except InvalidValueError as error:
        raise within(f"{path}:1", error) from error
    return sensors, _readings(path, lines, header, skipped)


def _readings(
    path: str, lines: Iterator[tuple[int, list[str]]], header: list[str], skipped: int
) -> Iterator[NDArray[np.bool_]]:
    """Yield each of `lines` as a reading, without its first `skipped` cells."""
    for line, row in lines:
        if len(row) != len(header):
            rule = f"must have {len(header)} cells, as many as the header"
            raise ShapeError(f"{path}:{line}", rule, len(row))
        cells = row[skipped:]
        if not _BITS.issuperset(cells):
            column = next(k for k, cell in enumerate(cells) if cell not in _BITS)
            where = f"{path}:{line}: {header[skipped + column]}"
            raise InvalidValueError(where, _rule(cells[column]), cells[column])
        yield np.array([cell == "1" for cell in cells])


def _rule(cell: str) -> str:
    """Return what a cell must be, with advice for what programs often write."""
    if not cell:
        return "must be 0 or 1 (unknown readings come by MQTT or NDJSON, not in a CSV)"
    if cell.lower() in {"true", "false"}:
        return "must be 0 or 1 (with pandas: frame.astype(int).to_csv)"
    if ";" in cell:
        return "must be 0 or 1 (write commas between cells, not semicolons)"
    return "must be 0 or 1"


def _lines(path: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line numbers and stripped cells, down to the blank lines at the end."""
    line = 0
    blank = 0
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            for row in reader:
                line = reader.line_num
                cells = [cell.strip() for cell in row]
                if cells in ([], [""]):
                    blank = blank or line
                    continue
                if blank:
                    rule = "must not be blank before the end of the file"
                    raise InvalidValueError(f"{path}:{blank}", rule, "")
                yield line, cells
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
        raise InvalidValueError("source", rule, path) from error
    except UnicodeDecodeError as error:
        wrong = error.object[error.start : error.end]
        raise InvalidValueError(path, "must be UTF-8 text", wrong) from error
    except csv.Error as error:
        where = f"{path}:{line + 1}"
        raise InvalidValueError(where, "must be CSV", str(error)) from error
