"""Exports a run as a CSV or Parquet table, written atomically.

There is a row per tick, a column per sensor. What was not recorded, and a reading that
was not known, is None. The state is one text: a letter a sensor, in their order, T
where the sensor itself is in the state, F where its complement is, ? where neither;
digits would be read back as a number.

CSV is UTF-8, with times in UTC, bits as 1 and 0, and unknown values empty; formulas
are marked as text, as `neurosnap.sources.csv_cells_and_formulas` says. Parquet has
typed columns; unknown values are null.
"""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import msgspec
import numpy as np

from neurosnap.agent.body import Body
from neurosnap.apps.new_files import placed
from neurosnap.errors import InvalidValueError, MissingExtraError, RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import Tick, ticks
from neurosnap.recording.replay.grown_sensors import births_of
from neurosnap.sensorium import unpack, unpack_readings
from neurosnap.sources.csv_cells_and_formulas import as_text
from neurosnap.system.distribution import must_have

Kind: TypeAlias = Literal["time", "number", "bit", "text"]
Cell: TypeAlias = int | bool | str | None
"""Times are nanoseconds since the epoch."""
_LATEST = 2**63
"""Times before this can be written as dates: up to the year 2262."""


class Column(NamedTuple):
    """What a column is called, and what it holds."""

    name: str
    kind: Kind


class Table:
    """Makes one row of a table from each tick.

    Args:
        body: What the run senses and does, with all that it grows; a sensor is not
            known before it is.
    """

    def __init__(self, body: Body) -> None:
        self._count, self._size = len(body.sensors), body.size
        self._names = body.sensors[: body.size]
        self._grows = body.room > 0
        self._decisions = body.actions
        time = Column("time", "time")
        before = (Column("tick", "number"), Column("begins", "bit"))
        after = (
            Column("state", "text"),
            *(Column(name, "number") for name in ("depth", "height", "edges")),
            Column("pulses", "number"),
            Column("incoherent", "bit"),
            Column("decision", "text"),
            Column("why", "text"),
            *(Column(name, "text") for name in ("grew", "retired") if self._grows),
        )
        taken = [column.name for column in (time, *before, *after)]
        names = _apart(self._names, taken)
        sensed = (Column(name, "bit") for name in names)
        self.columns: tuple[Column, ...] = (time, *before, *sensed, *after)

    def row(self, tick: Tick) -> list[Cell]:
        """Return the cells of a tick, one a column. O(N) time.

        Raises:
            RecordingError: It is not of such sensors and actions.
        """
        bits = self._bits(tick)
        begins = None if tick.observation is None else tick.observation.begins
        return [
            self._time(tick),
            tick.number,
            begins,
            *bits,
            *self._outcome(tick),
            *self._decided(tick),
            *self._changed(tick),
        ]

    def _time(self, tick: Tick) -> int | None:
        if tick.observation is None:
            return None
        if tick.at >= _LATEST:
            raise _wrong(tick, "time: must be before the year 2262", tick.at)
        return tick.at

    def _bits(self, tick: Tick) -> list[bool | None]:
        if tick.observation is None:
            return [None] * self._size
        try:
            bits, known = unpack_readings(
                tick.observation.bits, tick.observation.known, self._count
            )
        except ValueError as error:
            raise _wrong(tick, f"must be of {self._count} sensors", error) from error
        cells: list[bool | None] = bits[: self._size].tolist()
        if known is None:
            return cells
        sure = known[: self._size]
        return [bit if told else None for bit, told in zip(cells, sure, strict=True)]

    def _outcome(self, tick: Tick) -> list[Cell]:
        state = tick.state
        if state is None:
            return [None] * 6
        try:
            literals = unpack(state.literals, 2 * self._count)[: 2 * self._size]
        except ValueError as error:
            raise _wrong(tick, f"must be of {self._count} sensors", error) from error
        signs = np.where(literals[::2], "T", np.where(literals[1::2], "F", "?"))
        return [
            "".join(signs.tolist()),
            state.depth,
            state.height,
            state.edges,
            state.pulses,
            state.incoherent,
        ]

    def _decided(self, tick: Tick) -> list[Cell]:
        if tick.decision is None:
            return [None, None]
        action = tick.decision.action
        if action >= len(self._decisions):
            rule = f"decision: must be one of {len(self._decisions)}"
            raise _wrong(tick, rule, action)
        return [self._decisions[action] if action >= 0 else None, tick.decision.why]

    def _changed(self, tick: Tick) -> list[Cell]:
        """Return which sensor a tick's decision grew, and which it retired."""
        if not self._grows:
            return []
        decision = tick.decision
        named = (-1, -1) if decision is None else (decision.born, decision.retires)
        return [
            self._names[sensor] if 0 <= sensor < self._size else None
            for sensor in named
        ]


def _apart(names: Sequence[str], taken: Sequence[str]) -> list[str]:
    """Return names that no other column has: with underscores where one would."""
    every = {*names, *taken}
    apart: list[str] = []
    for name in names:
        found = name
        if name in taken:
            while found in every:
                found += "_"
            every.add(found)
        apart.append(found)
    return apart


def _wrong(tick: Tick, rule: str, got: object) -> RecordingError:
    return RecordingError(f"tick {tick.number}: {rule}, got {got}")


_CELLS = 1 << 20
"""About so many are held in memory before they are written as a row group."""


class Exported(msgspec.Struct, frozen=True):
    """The result of an export: the file, and how many ticks it holds."""

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
        rule = "must end with one of .csv, .parquet, .html, .mcap, .rosbag2"
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
