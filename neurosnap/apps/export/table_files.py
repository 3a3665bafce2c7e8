"""Writes a table as CSV or Parquet, a few rows at a time.

CSV is UTF-8, with times in UTC, bits as 1 and 0, and unknown values empty; what a
spreadsheet would run as a formula is marked as text, see `neurosnap.system.csv_text`.
Parquet has typed columns; unknown values are null.
"""

import csv
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import Protocol

import numpy as np

from neurosnap.apps.export.columns import Cell, Column, Kind
from neurosnap.errors import NeurosnapError
from neurosnap.system.csv_text import as_text
from neurosnap.system.distribution import must_have

_CELLS = 1 << 20
"""About so many are held in memory before they are written as a row group."""


class WriteTable(Protocol):
    """Writes a table."""

    def __call__(
        self, path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
    ) -> None:
        """Write a table.

        Args:
            path: What is there is replaced.
            columns: Its schema.
            rows: As `Table.row` gives them.

        Raises:
            OSError: It cannot be written.
        """


def write_csv(
    path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
) -> None:
    """Write a table row by row; see `WriteTable`."""
    shown = [_SHOWN[column.kind] for column in columns]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([as_text(column.name) for column in columns])
        for row in rows:
            writer.writerow(
                [
                    "" if cell is None else show(cell)
                    for show, cell in zip(shown, row, strict=True)
                ]
            )


def parquet_writer() -> WriteTable:
    """Return what writes Parquet, a row group after the other.

    Raises:
        NeurosnapError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        rule = must_have("pyarrow", "export")
        raise NeurosnapError(f"format: {rule}") from error
    types: dict[Kind, pa.DataType] = {
        "time": pa.timestamp("ns", tz="UTC"),
        "number": pa.int64(),
        "bit": pa.bool_(),
        "text": pa.string(),
    }

    def write(
        path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
    ) -> None:
        schema = pa.schema([(column.name, types[column.kind]) for column in columns])
        size = max(1, _CELLS // len(columns))
        left = iter(rows)
        with pq.ParquetWriter(path, schema) as writer:
            while group := list(islice(left, size)):
                cells = zip(*group, strict=True)
                arrays = [
                    pa.array(column, field.type)
                    for column, field in zip(cells, schema, strict=True)
                ]
                writer.write_table(pa.Table.from_arrays(arrays, schema=schema))

    return write


def _moment(cell: Cell) -> str:
    """Return a time as RFC 3339 has it, to the nanosecond."""
    return f"{np.datetime64(cell, 'ns')}Z"


def _bit(cell: Cell) -> str:
    return "1" if cell else "0"


_SHOWN: dict[Kind, Callable[[Cell], object]] = {
    "time": _moment,
    "number": str,
    "bit": _bit,
    "text": lambda cell: as_text(str(cell)),
}
