"""Data that are there already: what they may be, and how they are read."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli.shared import screen
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.meaning import Wanted
    from neurosnap.sources.tables.readings import Readings

Data = Annotated[
    Path,
    typer.Argument(
        metavar="DATA",
        help="A table of readings or a log of events (.csv, .parquet), a database of"
        " Home Assistant, the intervals of a home (.sensors), or a recording.",
    ),
]
Sensors = Annotated[
    list[str] | None,
    typer.Option(
        "--sensors",
        metavar="NAME",
        help="Read these sensors only; * and ? stand for any letters. Of a database"
        " of Home Assistant these instead of the binary sensors.",
        show_default="all",
    ),
]
When = Annotated[
    list[str] | None,
    typer.Option(
        "--when",
        metavar='"NAME > NUMBER"',
        help='When a sensor with numbers is on, such as "hall > 21" or, with'
        ' unit and hysteresis, "hall > 21 °C, off < 20".',
        show_default="none are read",
    ),
]
Time = Annotated[
    str | None,
    typer.Option(
        "--time",
        metavar="COLUMN",
        help="The column with the time.",
        show_default='the first, if it is called "time"',
    ),
]


def wanted(
    sensors: Sequence[str] | None, when: Sequence[str] | None, time: str | None
) -> "Wanted":
    """Return which sensors to read of data, and how.

    Raises:
        InvalidValueError: What is said of a sensor with numbers is not of that form.
    """
    from neurosnap.sources.meaning import Wanted, parse_comparison

    return Wanted(tuple(sensors or ()), tuple(map(parse_comparison, when or ())), time)


def opened(data: Path, wanted: "Wanted") -> "Recording | Readings":
    """Return the recording in a file, or else the readings in it.

    Raises:
        InvalidValueError: The file cannot be read, or breaks a rule; or it is a
            recording, and something else than all of it is wanted.
        RecordingError: It is a recording that cannot be read.
    """
    from neurosnap.apps.cli import output
    from neurosnap.recording.format.records import MAGIC
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.tables.open_readings import first_bytes, open_readings

    if not first_bytes(str(data)).startswith(MAGIC):
        with output.progress(screen, "reading", None) as on_progress:
            return open_readings(str(data), wanted, on_progress)
    if wanted.patterns or wanted.comparisons or wanted.time:
        rule = "must not go with a recording, whose sensors are known"
        raise InvalidValueError("sensors, when or time", rule, str(data))
    return Recording.open(data)
