"""Exports a recording to another format, whole or not at all."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, TypeAlias

import msgspec

from neurosnap.apps.export.columns import Cell, Table
from neurosnap.apps.export.graph_text import diagram, render
from neurosnap.apps.export.output_file import placed
from neurosnap.apps.export.table_files import WriteTable, parquet_writer, write_csv
from neurosnap.errors import InvalidValueError
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.births import births_of
from neurosnap.recording.replay.learning import snapshot_at

Form: TypeAlias = Literal["csv", "parquet", "graphml"]

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
        out: Where to; None: beside the recording.
        at: The tick whose order is written, with graphml; None: the last.
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
    draft: Path, recording: Recording, write: WriteTable, only_readings: bool
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
