"""A CSV file, line by line: cells between commas, semicolons or tabs, in UTF-8.

A file is read as it is gone through, and never held in memory. A cell may be in quotes,
but may not go over several lines: no name and no reading does.
"""

import csv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

from neurosnap.errors import InvalidValueError, ShapeError

OnProgress: TypeAlias = Callable[[int, int], object]
"""Told how much is read, and of how much."""

_MARK = b"\xef\xbb\xbf"
_REPORT = 1 << 20
"""Bytes between two reports."""


class CsvFile:
    """Reads the header, and then the lines below as often as asked.

    Args:
        path: Where it is.

    Attributes:
        path: The same.
        delimiter: What stands between cells: that one of the three which the header has
            most of.
        header: Its first line's cells.

    Raises:
        InvalidValueError: It cannot be read, or has no text.
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
        self.header = self._parsed(line, data)

    def lines(
        self, on_progress: OnProgress | None = None
    ) -> Iterator[tuple[int, bytes]]:
        """Yield the number and the text of each line below the header.

        Raises:
            InvalidValueError: While iterating: a line is blank, and not at the end, or
                the file cannot be read.
        """
        lines = _lines(self.path, on_progress)
        next(lines, None)
        return lines

    def cells(self, line: int, data: bytes) -> list[str]:
        """Return the cells of a line, without white space at their ends.

        Raises:
            ShapeError: It has another number of cells than the header.
            InvalidValueError: It is no CSV, or not UTF-8.
        """
        cells = self._parsed(line, data)
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


def _lines(
    path: str, on_progress: OnProgress | None = None
) -> Iterator[tuple[int, bytes]]:
    """Yield line numbers and stripped lines, down to the blank lines at the end."""
    blank = done = told = 0
    try:
        with Path(path).open("rb") as file:
            size = Path(path).stat().st_size
            for line, raw in enumerate(file, start=1):
                done += len(raw)
                if on_progress is not None and done >= told + _REPORT:
                    told = done
                    on_progress(done, size)
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
