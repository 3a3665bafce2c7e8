"""Reads CSV tables, and writes text that a spreadsheet will not run as a formula.

Cells are 0 and 1, false and true, off and on, or say that nothing is known. A file is
read as it is gone through, and never held in memory.

In a CSV file cells stand between commas, semicolons or tabs, in UTF-8. Rows of nothing
but 0 and 1 are read without a look at each cell. A cell may be in quotes, but may not
go over several lines: no name and no reading does.

Names come from files and programs of other people. A spreadsheet that opens a CSV file
runs what begins with ``=``, ``+``, ``-`` or ``@``, however it is quoted. An apostrophe
in front stops that. It is taken off again when the file is read here, and text that
begins with apostrophes and such a sign gets one more, so no name is changed on its way.
"""

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError, within
from neurosnap.sensorium import WORDS, Sensorium
from neurosnap.sources.conditions import Comparison
from neurosnap.sources.cuts import with_cuts
from neurosnap.sources.meaning import Numbers, Reader, refused
from neurosnap.sources.wanted import Wanted

_BITS = frozenset({"0", "1"})
_ZERO, _ONE = ord("0"), ord("1")
_TIMES = ("time", "timestamp", "datetime", "date", "")
_HEADER = "must be a header of sensor names"
_MARK = b"\xef\xbb\xbf"


class TableFile(Protocol):
    """A table file: a header, and lines with as many entries as the header has."""

    path: str
    header: list[str]
    delimiter: str
    """What stands between the cells of a line; empty where lines are cells."""

    def lines(self) -> Iterator[tuple[int, bytes | list[str]]]:
        """Yield the number of each line below the header, and its text or its cells."""

    def cells(self, line: int, data: bytes | list[str]) -> list[str]:
        """Return the cells of a line."""


class CsvFile:
    """A CSV file, whose lines can be read as often as asked.

    Attributes:
        path: Where it is.
        delimiter: What stands between cells: that one of the three which the header has
            most of.
        header: Its first line's cells. An apostrophe that keeps a spreadsheet from
            running one as a formula is left out (`neurosnap.system.csv_text`).

    Raises:
        InvalidValueError: It cannot be read, or has no text, or no header.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        line, data = next(_lines(path), (1, b""))
        if not data:
            raise InvalidValueError(
                path, "must have a header of sensor names", "no text"
            )
        outside = b"".join(data.split(b'"')[::2])
        self.delimiter = max(",;\t", key=lambda sign: outside.count(sign.encode()))
        self.header = [as_written(name) for name in self._parsed(line, data)]
        if _BITS.issuperset(self.header):
            # Readings without a header would lose their first row unnoticed.
            raise InvalidValueError(f"{path}:1", _HEADER, self.header)

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Yield the number and the text of each line below the header.

        Raises:
            InvalidValueError: While iterating: a line is blank, and not at the end, or
                the file cannot be read.
        """
        lines = _lines(self.path)
        next(lines, None)
        return lines

    def cells(self, line: int, data: bytes | list[str]) -> list[str]:
        """Return the cells of a line, without white space at their ends.

        Raises:
            ShapeError: It has another number of cells than the header.
            InvalidValueError: It is no CSV, or not UTF-8.
        """
        cells = self._parsed(line, data) if isinstance(data, bytes) else data
        if len(cells) != len(self.header):
            rule = f"must have {len(self.header)} cells, as many as the header"
            raise ShapeError(f"{self.path}:{line}", rule, len(cells))
        return cells

    def _parsed(self, line: int, data: bytes) -> list[str]:
        try:
            text = data.decode()
        except UnicodeDecodeError as error:
            wrong = error.object[error.start : error.end]
            raise InvalidValueError(self.path, "must be UTF-8 text", wrong) from error
        try:
            rows = csv.reader([text], delimiter=self.delimiter, strict=True)
            return [cell.strip() for cell in next(rows)]
        except csv.Error as error:
            where = f"{self.path}:{line}"
            raise InvalidValueError(where, "must be CSV", str(error)) from error


def _lines(path: str) -> Iterator[tuple[int, bytes]]:
    """Yield line numbers and stripped lines, down to the blank lines at the end."""
    blank = 0
    try:
        with Path(path).open("rb") as file:
            for line, raw in enumerate(file, start=1):
                data = raw.removeprefix(_MARK) if line == 1 else raw
                # Not tabs: they stand between cells, of which any may be empty.
                if not (data := data.strip(b"\r\n ")).strip():
                    blank = blank or line
                    continue
                if blank:
                    rule = "must not be blank before the end of the file"
                    raise InvalidValueError(f"{path}:{blank}", rule, "")
                yield line, data
    except OSError as error:
        rule = f"must be a file that can be read ({error.strerror})"
        raise InvalidValueError("source", rule, path) from error


class TableRow(NamedTuple):
    """One row of a table: its time and its readings."""

    time: str
    """What its column of time says; nothing, if there is none."""
    bits: NDArray[np.bool_]
    """``(N,)``."""
    known: NDArray[np.bool_] | None
    """``(N,)``; None if all are."""
    said: bytes = b""
    """The numbers behind it; see `wire.Observation`."""


class TableRows:
    """The readings of the wanted sensors in a table.

    A first column that is called ``time``, or has no name, holds no sensor.

    Attributes:
        sensors: Their names.
        wanted: What is wanted, with cuts.
        timed: Whether a column holds the time.

    Raises:
        InvalidValueError: The header breaks a rule.
    """

    def __init__(self, file: TableFile, wanted: Wanted) -> None:
        header, where = file.header, f"{file.path}:1"
        self._file = file
        self._skipped = _skipped(header, wanted, where)
        self.timed = self._skipped is not None and header[self._skipped] != ""
        self._names = [
            (place, name) for place, name in enumerate(header) if place != self._skipped
        ]
        names = [name for _, name in self._names]
        if not names:
            raise InvalidValueError(where, _HEADER, header)
        wanted = wanted.parsed(names)
        wanted.check(names, where)
        self.wanted = with_cuts(wanted, self._values(wanted))
        readers = [reader.name for _, reader in self._readers()]
        try:
            self.sensors = Sensorium(readers).names
        except InvalidValueError as error:
            raise within(where, error) from error

    def rows(self) -> Iterator[TableRow]:
        """Yield the rows below the header.

        Raises:
            InvalidValueError: While iterating: a row breaks a rule.
        """
        readers = self._readers()
        words = all(reader.condition is None for _, reader in readers)
        numbers = Numbers([reader for _, reader in readers])
        compares = any(isinstance(each.condition, Comparison) for _, each in readers)
        all_of_them = words and len(readers) == len(self._names)
        for line, data in self._file.lines():
            row = None
            if all_of_them and isinstance(data, bytes):
                row = self._plain(data)
            row = row or self._row(line, self._file.cells(line, data), readers)
            yield row._replace(said=numbers.packed(row.known)) if compares else row

    def _values(self, wanted: Wanted) -> Iterator[tuple[str, str, bool]]:
        """Yield what the signals say that are taken as they are, for `with_cuts`."""
        if self._file.delimiter and self._is_plain():
            return  # for speed
        taken = [(place, name) for place, name in self._names if wanted.takes(name)]
        last = math.inf
        if wanted.learned < 1:
            last = wanted.learned * sum(1 for _ in self._file.lines())
        for count, (line, data) in enumerate(self._file.lines()):
            cells = self._file.cells(line, data)
            for place, name in taken:
                yield name, cells[place], count < last

    def _is_plain(self) -> bool:
        """Return whether a file of CSV holds nothing but 0 and 1."""
        sign = re.escape(self._file.delimiter)
        head = f'[^"{sign}]*' if self._skipped == 0 else "[01]"
        plain = re.compile(f"{head}(?:{sign}[01])*".encode())
        lines = (data for _, data in self._file.lines())
        return all(isinstance(data, bytes) and plain.fullmatch(data) for data in lines)

    def _readers(self) -> list[tuple[int, Reader]]:
        """Return what reads which column."""
        return [
            (place, reader)
            for place, name in self._names
            for reader in self.wanted.readers(name)
        ]

    def _plain(self, data: bytes) -> TableRow | None:
        """Return a row of CSV in which all cells are 0 or 1; None if it is another."""
        delimiter = self._file.delimiter.encode()
        time = b""
        if self._skipped == 0:
            time, _, data = data.partition(delimiter)
        elif self._skipped is not None:
            return None
        if len(data) != 2 * len(self._names) - 1 or b'"' in time:
            return None
        letters = np.frombuffer(data, np.uint8)
        bits = letters[::2] == _ONE
        if not (bits | (letters[::2] == _ZERO)).all():
            return None
        if not (letters[1::2] == delimiter[0]).all() or not time.isascii():
            return None
        return TableRow(time.decode().strip(), bits, None)

    def _row(
        self, line: int, cells: list[str], readers: list[tuple[int, Reader]]
    ) -> TableRow:
        values: list[bool | None] = []
        for place, reader in readers:
            cell = cells[place]
            if reader.condition is None and cell in WORDS:
                values.append(WORDS[cell])
                continue
            try:
                values.append(reader.read(cell))
            except ValueError as error:
                where = f"{self._file.path}:{line}"
                raise refused(where, self._file.header[place], error, cell) from None
        time = cells[self._skipped] if self.timed and self._skipped is not None else ""
        bits = np.array([value is True for value in values], np.bool_)
        if None not in values:
            return TableRow(time, bits, None)
        return TableRow(time, bits, np.array([value is not None for value in values]))


def _skipped(header: list[str], wanted: Wanted, where: str) -> int | None:
    """Return which column holds no sensor."""
    if wanted.time is not None:
        if wanted.time not in header:
            raise InvalidValueError(where, "must have this column", wanted.time)
        return header.index(wanted.time)
    # Pandas writes a first column without a name: numbers of rows.
    first = header[0].casefold()
    return 0 if (first in _TIMES and len(header) > 1) or header == ["time"] else None


# Also as wide letters, which some spreadsheets take for the same; and behind what they
# skip at the beginning.
_FORMULA = re.compile(r"'*[\t\r\n]*[=+\-@＝＋－＠]")


def as_text(text: str) -> str:
    """Return `text` with an apostrophe before it if a spreadsheet would run it.

    Examples:
        >>> as_text("=1+1"), as_text("door"), as_text("-")
        ("'=1+1", 'door', '-')
    """
    # A lone sign is no formula; as a decision it says that nothing was done.
    return f"'{text}" if len(text) > 1 and _FORMULA.match(text) else text


def as_written(text: str) -> str:
    """Undo `as_text`: return the text without its apostrophe.

    Examples:
        >>> as_written("'=1+1"), as_written("'tis")
        ('=1+1', "'tis")
    """
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text
