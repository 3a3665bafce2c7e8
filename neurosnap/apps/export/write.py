"""Exports a recording to another format, whole or not at all.

CSV is UTF-8, with times in UTC, bits as 1 and 0, and unknown values empty; what a
spreadsheet would run as a formula is marked as text, see `neurosnap.system.csv_text`.
Parquet has typed columns; unknown values are null.
"""

import csv
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

import msgspec
import numpy as np

from neurosnap.apps.export.columns import Cell, Column, Kind, Table
from neurosnap.apps.export.graph_text import diagram, render
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.births import births_of
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.system.csv_text import as_text
from neurosnap.system.distribution import must_have
from neurosnap.system.durable import replacing

Form: TypeAlias = Literal["csv", "parquet", "graphml"]

_EVERYBODY = 0o666
_CELLS = 1 << 20
"""About so many are held in memory before they are written as a row group."""
_ENDINGS: dict[Form, str] = {
    "csv": ".csv",
    "parquet": ".parquet",
    "graphml": ".graphml",
}


class Exported(msgspec.Struct, frozen=True):
    """What was written."""

    path: str
    format: Form
    ticks: int
    """How many ticks are in it, or by which tick it was learned."""
    incomplete: int
    """Ticks in a table that lack a reading or a state."""
    whole: bool
    """The recording has its end, and nothing that was sent is missing from it."""
    damage: tuple[str, ...] = ()
    """What of it cannot be read; see `Recording.damage`."""


def form_of(path: Path) -> Form | None:
    """Return the format that a file's name asks for; None if it is a recording's own.

    Raises:
        InvalidValueError: There is none with such an ending.
    """
    for form, ending in _ENDINGS.items():
        if path.name.lower().endswith(ending):
            return form
    if path.suffix.lower() == ".mcap":
        return None
    known = ", ".join((*_ENDINGS.values(), ".mcap"))
    raise InvalidValueError("out", f"must end with one of {known}", str(path))


def export(
    log: Path,
    form: Form,
    out: Path | None = None,
    *,
    at: int | None = None,
    only_readings: bool = False,
    force: bool = False,
) -> Exported:
    """Write a recording in another format.

    A recording that was cut short is written as far as it goes, and of one that is
    damaged what can be read. Memory is bounded; a
    table takes O(ticks · N) time.

    Args:
        log: A recording, or the first of its files for all of them.
        form: The format.
        out: Where to; None for a file beside the recording.
        at: The tick whose order is written, with graphml; None for the last.
        only_readings: With csv: what ``neurosnap run`` takes as a source.
        force: Replace what is there.

    Raises:
        InvalidValueError: An option does not go with the format, or breaks its rule.
        NeurosnapError: The recording is damaged or not a run's, or what the format
            takes is not installed.
        OSError: It cannot be written.
    """
    if at is not None and form != "graphml":
        raise InvalidValueError("at", "must go with a file .graphml", at)
    if only_readings and form != "csv":
        raise InvalidValueError("only-readings", "must go with a file .csv", form)
    recording = Recording.open(log)
    path = log.with_name(f"{log.stem}{_ENDINGS[form]}") if out is None else out
    reads = (log, *part_paths(log).values())
    with placed(path, force=force, reads=reads) as draft:
        count, incomplete = _write(draft, recording, form, at, only_readings)
    whole, damage = recording.whole, recording.damage
    return Exported(str(path), form, count, incomplete, whole, damage)


def _write(
    draft: Path, recording: Recording, form: Form, at: int | None, only_readings: bool
) -> tuple[int, int]:
    """Write a format; return how many ticks are in it, and lack something."""
    match form:
        case "csv":
            return _write_table(draft, recording, write_csv, only_readings)
        case "parquet":
            return _write_table(draft, recording, parquet_writer(), only_readings)
        case "graphml":
            tick, snapshot = snapshot_at(recording, at)
            births = births_of(recording)
            drawn = diagram(tick, snapshot.poc_graph(), snapshot.sensorium, births)
            draft.write_text(render(drawn, "graphml"), encoding="utf-8")
            return tick, 0


def _write_table(
    draft: Path, recording: Recording, write: "WriteTable", only_readings: bool
) -> tuple[int, int]:
    table = Table(births_of(recording).body, only_readings=only_readings)
    count = incomplete = 0

    def rows() -> Iterator[list[Cell]]:
        nonlocal count, incomplete
        for tick in ticks(recording):
            count += 1
            incomplete += not tick.known
            yield table.row(tick)

    write(draft, table.columns, rows())
    return count, incomplete


@contextmanager
def placed(path: Path, *, force: bool, reads: Collection[Path]) -> Iterator[Path]:
    """Give a place to write, which becomes `path` if nothing goes wrong.

    Only those may read it who may read all that is exported.

    Args:
        path: Where to.
        force: Replace what is there.
        reads: What is exported; not even `force` replaces that.

    Raises:
        InvalidValueError: There is something already, or no folder for it.
        OSError: It cannot be written.
    """
    if path.exists():
        # Nor a folder, a pipe or a device, which would make place for a file.
        if not path.is_file() or any(path.samefile(source) for source in reads):
            raise InvalidValueError("out", "must be another file", str(path))
        if not force:
            rule = "must not exist yet, or come with --force"
            raise InvalidValueError("out", rule, str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    allowed = _EVERYBODY
    for source in reads:
        allowed &= source.stat().st_mode
    with replacing(path, allowed) as draft:
        yield draft


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
