"""``neurosnap learn`` and ``health``: what existing data say.

A table of relations is made of readings in a file, or of what a run has learned.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from neurosnap.apps.cli import output
from neurosnap.apps.cli.options import as_share, with_parameters
from neurosnap.apps.cli.relations import MOST, Every, Out, check_out, show, write
from neurosnap.apps.cli.shared import (
    LEARN,
    Force,
    Format,
    OptionalTick,
    app,
    end_by,
    errors,
    people,
    print_facts,
    screen,
    unwinding,
)
from neurosnap.errors import InvalidValueError

if TYPE_CHECKING:
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.meaning import Wanted
    from neurosnap.sources.tables.readings import Readings

GraphForm: TypeAlias = Literal["text", "json", "dot", "graphml"]
_EXAMPLE = "Example: neurosnap learn home-assistant_v2.db --out home.html"
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


Threshold = Annotated[
    str | None,
    typer.Option(
        metavar="SHARE",
        help="Show what a run with this threshold learns: a number, or the word auto; or"
        " the word sure: what the readings leave no doubt about.",
        show_default="sure; of a recording, what its run has learned",
    ),
]


_with_choice = with_parameters(
    sensors=(Sensors, None), when=(When, None), time=(Time, None)
)


@app.command(epilog=_EXAMPLE, rich_help_panel=LEARN)
@_with_choice
def learn(
    context: typer.Context,
    data: Data,
    out: Out = None,
    every: Every = False,
    threshold: Threshold = None,
    at: OptionalTick = None,
    force: Force = False,
    form: Annotated[
        GraphForm,
        typer.Option(
            "--format",
            help="Print a table: each implication with how often it was put to the test,"
            " and how often it failed. Or one JSON object. Or the order that was learned,"
            " as dot (for Graphviz) or graphml.",
        ),
    ] = "text",
) -> None:
    """Report which sensors imply which, in readings or in a recording."""
    from neurosnap.apps.export.learned import learned_from

    with errors():
        if out is not None:
            check_out(out)
            if form in ("dot", "graphml"):
                rule = "must go with the table; other formats go to standard output"
                raise InvalidValueError("out", rule, str(out))
        found = _opened(data, _wanted(context))
        with output.progress(screen, "pairs", None) as on_progress:
            share = None if threshold is None else as_share(threshold)
            learned = learned_from(str(data), found, share, at, on_progress)
            answered = learned.table(every, on_progress)
        if form in ("dot", "graphml"):
            # For programs, which take it for UTF-8 whatever a terminal is.
            typer.echo(learned.graph(form).encode())
        else:
            if out is not None:
                with unwinding():
                    write(answered, out, data, force=force)
            recorded = threshold is None and learned.recorded
            show(people(form), answered, out, None if recorded else MOST)
            if not answered.rows and learned.sure:
                hint = "more readings may help; --threshold shows what a run learns"
                people(form).print(hint)
            print_facts(form, learned.facts(answered))
        if learned.recording is not None:
            end_by(learned.recording)


@app.command(
    epilog="Example: neurosnap health home-assistant_v2.db --alarms 1/month",
    rich_help_panel=LEARN,
)
@_with_choice
def health(
    context: typer.Context,
    data: Data,
    alarms: Annotated[
        str,
        typer.Option(
            metavar="N/TIME",
            help="How many alarms the home may raise while nothing is wrong, such as"
            " 1/week or 2/month.",
        ),
    ] = "1/week",
    form: Format = "text",
) -> None:
    """Report which sensors of a home seem broken, since when, and why."""
    from neurosnap.apps import health_log
    from neurosnap.recording.read.recording import Recording

    with errors():
        there = _opened(data, _wanted(context))
        if isinstance(there, Recording):
            names = there.options.body.own
            observations = health_log.in_recording(there)
        else:
            names = there.columns.sensorium.names
            observations = health_log.in_table(there)
        found = health_log.follow(observations, names, alarms)
        for line in found.lines():
            people(form).print(line, markup=False, soft_wrap=True)
        print_facts(form, found)
        if isinstance(there, Recording):
            end_by(there)


def _wanted(context: typer.Context) -> "Wanted":
    """Return which sensors to read of data, and how.

    Raises:
        InvalidValueError: What is said of a sensor with numbers is not of that form.
    """
    from neurosnap.sources.meaning import Wanted, parse_comparison

    given = context.params
    comparisons = tuple(map(parse_comparison, given["when"] or ()))
    return Wanted(tuple(given["sensors"] or ()), comparisons, given["time"])


def _opened(data: Path, wanted: "Wanted") -> "Recording | Readings":
    """Return the recording in a file, or else the readings in it.

    Raises:
        InvalidValueError: The file cannot be read, or breaks a rule; or it is a
            recording, and something else than all of it is wanted.
        RecordingError: It is a recording that cannot be read.
    """
    from neurosnap.recording.format.records import MAGIC
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.tables.open_readings import first_bytes, open_readings

    recorded = data.suffix.lower() == ".mcap"
    if not recorded and not first_bytes(str(data)).startswith(MAGIC):
        with output.progress(screen, "reading", None) as on_progress:
            return open_readings(str(data), wanted, on_progress)
    if wanted.patterns or wanted.comparisons or wanted.time:
        rule = "must not go with a recording, whose sensors are known"
        raise InvalidValueError("sensors, when or time", rule, str(data))
    return Recording.open(data)
