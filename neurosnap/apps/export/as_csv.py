"""CSV export: UTF-8, times in UTC, bits as 1 and 0, unknown values empty.

What a spreadsheet would run as a formula is marked as text, see
`neurosnap.system.csv_text`.
"""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from neurosnap.apps.export.columns import Cell, Column, Kind
from neurosnap.system.csv_text import as_text


def write_csv(
    path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
) -> None:
    """Write a table, row by row; nothing of it is held in memory.

    Args:
        path: What is there is replaced.
        columns: Its header.
        rows: As `Table.row` gives them.

    Raises:
        OSError: It cannot be written.
    """
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
