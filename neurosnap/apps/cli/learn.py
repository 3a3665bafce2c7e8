"""``neurosnap learn``: the relations of sensors in readings that are there already."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli.relations import MOST, Every, Force, Out
from neurosnap.apps.cli.shared import (
    Json,
    app,
    end_by,
    errors,
    print_json,
    say,
    screen,
)
from neurosnap.apps.cli.stopping import unwinding
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.recording.read.reader import Recording
    from neurosnap.sources.tables.meaning import Wanted
    from neurosnap.sources.tables.readings import Readings

_BYTES_A_PAIR = 100
"""Of two sensors: their counts and what is judged of them. Measured: 85, of 2,000."""
_RULE = "by the table's own rule"
_EXAMPLE = "Example: neurosnap learn home-assistant_v2.db --out home.html"


@app.command(epilog=_EXAMPLE)
def learn(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA",
            help="A table of readings or a log of events (.csv, .parquet), a database of"
            " Home Assistant, the intervals of a home (.sensors), or a recording.",
        ),
    ],
    out: Out = None,
    every: Every = False,
    threshold: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE",
            help="Show what a run with this threshold learns, instead of what is sure:"
            " a number, or the word auto.",
        ),
    ] = None,
    sensors: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Read these sensors only; * and ? stand for any letters. Of a database"
            " of Home Assistant these instead of the binary sensors.",
            show_default="all",
        ),
    ] = None,
    when: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"NAME > NUMBER"',
            help='When a sensor with numbers is on, such as "hall > 21" or, with'
            ' unit and hysteresis, "hall > 21 °C, off < 20".',
            show_default="none are read",
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMN",
            help="The column with the time.",
            show_default='the first, if it is called "time"',
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Tell which sensors imply which, in readings that are there already."""
    from neurosnap.apps.cli import output
    from neurosnap.apps.cli.options import as_share
    from neurosnap.apps.cli.relations import check_out, show, write
    from neurosnap.apps.export.relations import Answered
    from neurosnap.poc.learning.empirical import EmpiricalSnapshot
    from neurosnap.poc.learning.relation_table import tabulate
    from neurosnap.sources.tables.meaning import Wanted, parse_comparison

    with errors():
        if out is not None:
            check_out(out)
        wanted = Wanted(
            tuple(sensors or ()), tuple(map(parse_comparison, when or ())), time
        )
        recording, readings = _read(data, wanted)
        _check_room(len(readings.columns.sensorium))
        with output.progress(screen, "pairs", None) as on_progress:
            fitted = None
            if threshold is not None:
                fitted = EmpiricalSnapshot.fit(
                    readings.columns, as_share(threshold), on_progress=on_progress
                )
            rows = tabulate(readings.columns, fitted, every, on_progress)
        learned = _RULE if threshold is None else f"threshold {threshold}"
        answered = Answered(str(data), readings, rows, learned)
        if out is not None:
            with unwinding():
                write(answered, out, data, force=force)
        show(say(as_json), answered, out, MOST)
        if not rows and threshold is None:
            say(as_json).print(
                "more readings may tell; --threshold shows what a run learns"
            )
        if as_json:
            print_json(msgspec.to_builtins(answered.facts()))
        if recording is not None:
            end_by(recording)


def _read(data: Path, wanted: "Wanted") -> "tuple[Recording | None, Readings]":
    """Return the readings, and the recording if they are in one."""
    from neurosnap.apps.cli import output
    from neurosnap.recording.format.records import MAGIC
    from neurosnap.sources.tables.open_readings import first_bytes, open_readings

    if not first_bytes(str(data)).startswith(MAGIC):
        with output.progress(screen, "reading", None) as on_progress:
            return None, open_readings(str(data), wanted, on_progress)
    from neurosnap.recording.read.learned_at import snapshot_at
    from neurosnap.recording.read.readings_of import readings_of
    from neurosnap.recording.read.split_files import open_whole

    if wanted.patterns or wanted.comparisons or wanted.time:
        rule = "must not go with a recording, whose sensors are known"
        raise InvalidValueError("sensors, when or time", rule, str(data))
    recording = open_whole(data)
    tick, snapshot = snapshot_at(recording)
    return recording, readings_of(recording, snapshot.sensorium, tick)


def _check_room(sensors: int) -> None:
    """Refuse more sensors than there is memory for all their pairs.

    Raises:
        InvalidValueError: There are more.
    """
    from neurosnap.system.resources import free_memory

    needed, free = _BYTES_A_PAIR * sensors * (sensors - 1) // 2, free_memory()
    if needed > free:
        rule = (
            f"must be fewer here: their pairs take {needed / 1e9:,.1f} GB, free are"
            f" {free / 1e9:.1f} GB (choose some with --sensors)"
        )
        raise InvalidValueError("sensors", rule, sensors)
