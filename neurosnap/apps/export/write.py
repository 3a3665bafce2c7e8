"""Exports the ticks of a recording as CSV or Parquet, whole or not at all.

CSV is UTF-8, with times in UTC, bits as 1 and 0, and unknown values empty; what a
spreadsheet would run as a formula is marked as text, as
`neurosnap.sources.tables.csv_file` says.
Parquet has typed columns; unknown values are null.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np

from neurosnap.apps.export.columns import Cell, Column, Kind, Table
from neurosnap.apps.new_files import placed
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.births import births_of
from neurosnap.sources.tables.csv_file import as_text
from neurosnap.system.distribution import must_have

_CELLS = 1 << 20
"""About so many are held in memory before they are written as a row group."""


class Exported(msgspec.Struct, frozen=True):
    """What was written."""

    path: str
    ticks: int
    """How many ticks are in it."""
    incomplete: int
    """How many of these lack a reading or a state."""
    whole: bool
    """The recording has its end, and nothing that was sent is missing from it."""


def export(
    recording: Recording,
    out: Path,
    *,
    force: bool = False,
) -> Exported:
    """Write a row for each tick of a recording, in the format of a file's ending.

    A recording that was cut short is written as far as it goes, and of one that is
    damaged what can be read. Memory is bounded; it takes O(ticks · N) time.

    Args:
        recording: What is written.
        out: A file .csv or .parquet.
        force: Replace what is there.

    Raises:
        InvalidValueError: There is no such format, or a file is there already.
        NeurosnapError: The recording is damaged or not a run's, or what the format
            takes is not installed.
        OSError: It cannot be written.
    """
    ending = out.suffix.lower()
    if ending not in (".csv", ".parquet"):
        rule = "must end with one of .csv, .parquet, .mcap"
        raise InvalidValueError("out", rule, str(out))
    write = write_csv if ending == ".csv" else write_parquet
    table = Table(births_of(recording).body)
    count = incomplete = 0

    def rows() -> Iterator[list[Cell]]:
        nonlocal count, incomplete
        for tick in ticks(recording):
            count += 1
            incomplete += not tick.known
            yield table.row(tick)

    reads = [file.path for file in recording.files]
    with placed(out, force=force, reads=reads) as draft:
        write(draft, table.columns, rows())
    return Exported(str(out), count, incomplete, recording.whole)


def write_csv(
    path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
) -> None:
    """Write a table row by row, as `Table.row` gives them."""
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


def write_parquet(
    path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
) -> None:
    """Write a table likewise, a row group after the other.

    Raises:
        MissingExtraError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        rule = must_have("pyarrow", "export")
        raise MissingExtraError(f"out: {rule}") from error
    types: dict[Kind, pa.DataType] = {
        "time": pa.timestamp("ns", tz="UTC"),
        "number": pa.int64(),
        "bit": pa.bool_(),
        "text": pa.string(),
    }
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


_SHOWN: dict[Kind, Callable[[Cell], object]] = {
    # As RFC 3339 has a time, to the nanosecond.
    "time": lambda cell: f"{np.datetime64(cell, 'ns')}Z",
    "number": str,
    "bit": lambda cell: "1" if cell else "0",
    "text": lambda cell: as_text(str(cell)),
}
