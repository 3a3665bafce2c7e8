"""Parquet export: typed columns, unknown values null."""

from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from neurosnap.apps.export.columns import Cell, Column, Kind

_CELLS = 1 << 20
"""About so many are held in memory before they are written as a row group."""

_TYPES: dict[Kind, pa.DataType] = {
    "time": pa.timestamp("ns", tz="UTC"),
    "number": pa.int64(),
    "bit": pa.bool_(),
    "text": pa.string(),
}


def write_parquet(
    path: Path, columns: Sequence[Column], rows: Iterable[Sequence[Cell]]
) -> None:
    """Write a table, a row group after the other.

    Args:
        path: What is there is replaced.
        columns: Its schema.
        rows: As `Table.row` gives them.

    Raises:
        OSError: It cannot be written.
    """
    schema = pa.schema([(column.name, _TYPES[column.kind]) for column in columns])
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
