"""``neurosnap learn``, ``compare`` and ``health``, which read existing data.

A table of relations is made of readings in a file, or of what a run has learned.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    LOST,
    Force,
    Format,
    OptionalTick,
    end_by,
    errors,
    unwinding,
)
from neurosnap.apps.cli.run_flags import FLAG, as_share, with_parameters
from neurosnap.apps.cli.terminal_output import print_facts, progress, say, table

if TYPE_CHECKING:
    from neurosnap.apps.export.relations import Findings
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.readings import Readings
    from neurosnap.sources.wanted import Wanted

_MOST = 40
"""Rows that a terminal is shown; `--out` writes all."""
_EXAMPLE = "Example: neurosnap learn home-assistant_v2.db --out home.html"
_KINDS = (
    "A table of readings or a log of events (.csv, .parquet), a database of Home"
    " Assistant, messages of another program (.mcap, or a bag's folder), or a recording"
)
Data = Annotated[Path, typer.Argument(metavar="DATA", help=f"{_KINDS}.")]
Good = Annotated[
    Path, typer.Argument(metavar="GOOD", help=f"{_KINDS}, of a machine that is right.")
]
New = Annotated[
    Path, typer.Argument(metavar="NEW", help="The same, of that machine later on.")
]
Sensors = Annotated[
    list[str] | None,
    typer.Option(
        "--sensors",
        metavar="NAME",
        help="Read these sensors only, or topics, or conditions as --when has them; *"
        " and ? stand for any letters. Of a database of Home Assistant these instead of"
        " the binary sensors.",
        show_default="all",
    ),
]
When = Annotated[
    list[str] | None,
    typer.Option(
        "--when",
        metavar='"NAME > NUMBER"',
        help='When a signal is on, such as "hall > 21", with unit and hysteresis'
        ' "hall > 21 °C, off < 20", or "mode = auto", "level rises" (falls, changes);'
        ' of messages, too, "min(/scan.ranges[0:80]) < 0.5" (max, mean, any, all, count)'
        ' and "/scan heard within 0.5 s". May be repeated.',
        show_default="numbers at their quartiles, each of a few words",
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

Bins = Annotated[
    int,
    typer.Option(
        metavar="PARTS",
        min=0,
        help="Parts that the range of a number is cut into, each with about as many"
        " values. 0: no number is read by itself.",
    ),
]
Period = Annotated[
    str,
    typer.Option(
        "--every",
        metavar="TIME",
        help="From row to row of messages: seconds, or 100ms, 2min, 1h.",
        show_default="as is usual for its topics",
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
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="Write the whole table to a .csv file, or to a .html file with a picture of"
        " the order.",
        show_default="the terminal",
    ),
]
Every = Annotated[
    bool,
    typer.Option(
        "--all", metavar=FLAG, help="Show the relations that follow from others, too."
    ),
]
Premises = Annotated[
    int,
    typer.Option(
        metavar="NUMBER",
        min=1,
        max=3,
        help="Look for up to so many sensors that imply another together, as in belt ∧"
        " gate* implies counter. A star means off. 1: each by itself.",
    ),
]
Lag = Annotated[
    int,
    typer.Option(
        metavar="TICKS",
        min=0,
        max=63,
        help="Look for what comes late, up to so many ticks, as in valve implies flow"
        " within 3 s. 0: only for what holds at once.",
    ),
]
_with_choice = with_parameters(
    sensors=(Sensors, None),
    when=(When, None),
    time=(Time, None),
    bins=(Bins, 4),
    period=(Period, "0"),
)


@app.command(epilog=_EXAMPLE)
@_with_choice
def learn(
    context: typer.Context,
    data: Data,
    out: Out = None,
    every: Every = False,
    premises: Premises = 2,
    lag: Lag = 32,
    threshold: Threshold = None,
    at: OptionalTick = None,
    force: Force = False,
    form: Format = "text",
) -> None:
    """Report which sensors imply which, in readings or in a recording.

    Each relation comes with how often it was put to the test, how often it failed, and
    what it promises: how rarely it will fail. What never failed comes first. What is
    learned of the first half of the readings is held against the second.
    """
    from neurosnap.apps.export.relations import form_of, learned_from
    from neurosnap.poc.learning.beyond_pairs import Limits
    from neurosnap.recording.read.recording import Recording

    with errors():
        if out is not None:
            form_of(out)
        found = _opened(data, context)
        share = None if threshold is None else as_share(threshold)
        with progress("pairs") as on_progress:
            learned = learned_from(
                str(data),
                found,
                share,
                at=at,
                every=every,
                limits=Limits(premises, lag),
                on_progress=on_progress,
            )
        if out is None:
            say(form, *_lines(learned), learned.title, *learned.check.splitlines())
        else:
            with unwinding():
                learned.write(out, force=force, reads=data)
            say(form, learned.title, f"wrote {out}")
        if not learned.rows and threshold is None:
            say(form, "more readings may help; --threshold shows what a run learns")
        print_facts(form, learned.facts())
        if isinstance(found, Recording):
            end_by(found)


def _lines(learned: "Findings") -> Iterator[str]:
    """Yield the strongest relations as a table, and where the others are."""
    from neurosnap.apps.export.relations import HEADS

    if rows := [learned.cells(row) for row in learned.rows[:_MOST]]:
        yield from table([HEADS, *rows], numbers=True)
    yield from _left(len(learned.rows))


@app.command(
    epilog="Example: neurosnap compare good.csv new.csv --out changes.html",
)
@_with_choice
def compare(
    context: typer.Context,
    good: Good,
    new: New,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Write the whole table to a .csv, .json or .html file.",
            show_default="the terminal",
        ),
    ] = None,
    force: Force = False,
    form: Format = "text",
) -> None:
    """Report whether a machine changed: what differs between two recordings of it.

    Exit code 0: nothing differs by more than chance; 1: something does; 3: nothing
    does, but a recording is not whole, or only one has a sensor.
    """
    from neurosnap.apps.export.relations import form_of
    from neurosnap.apps.export.two_recordings import FORMS, HEADS, contrast, open_second
    from neurosnap.recording.read.recording import Recording

    with errors():
        if out is not None:
            form_of(out, FORMS)
        wanted = _wanted(context)
        first = _opened(good, context)
        with progress("reading"):
            both = first, open_second(new, wanted, first)
        with progress("pairs") as on_progress:
            found = contrast((str(good), str(new)), both, on_progress)
        rows = [found.cells(row) for row in found.found.rows]
        if out is None:
            say(form, *(table([HEADS, *rows[:_MOST]]) if rows else ()))
            say(form, *_left(len(rows)))
        else:
            with unwinding():
                found.write(out, force=force, reads=(good, new))
        say(form, *found.lines())
        say(form, *([] if out is None else [f"wrote {out}"]))
        print_facts(form, found.facts())
        if rows:
            raise typer.Exit(1)
        for each in both:
            if isinstance(each, Recording):
                end_by(each)
        if any(found.alone):
            raise typer.Exit(LOST)


def _left(rows: int) -> Iterator[str]:
    """Say where the rows are that a terminal does not show."""
    if rows > _MOST:
        yield f"and {rows - _MOST} more: --out FILE"


@app.command(
    epilog="Example: neurosnap health home-assistant_v2.db --alarms 1/month",
)
@_with_choice
def health(
    context: typer.Context,
    data: Data,
    alarms: Annotated[
        str,
        typer.Option(
            metavar="N/TIME",
            help="How many alarms may be raised while nothing is wrong, such as 1/week"
            " or 2/month.",
        ),
    ] = "1/week",
    zone: Annotated[
        str | None,
        typer.Option(
            metavar="ZONE",
            help="The home's time zone, such as Europe/Berlin; if not given, the"
            " recording's or Home Assistant's own, else UTC.",
        ),
    ] = None,
    step: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
            help="Judge the sensors as a machine's, in steps of this length, such as 1s;"
            " 0s: as a home's, by how often they come on in ten minutes.",
            show_default="a machine's, if readings are regular or under 10 s apart",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Report which sensors of a home or a machine seem broken, since when, and why."""
    from neurosnap.apps.health_of_readings import health_of
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.conditions import parse_span

    with errors():
        opened = _opened(data, context)
        span = None if step is None else parse_span(step, "step")
        found = health_of(opened, alarms, zone, span)
        say(form, *found.lines())
        print_facts(form, found)
        if isinstance(opened, Recording):
            end_by(opened)


def _opened(data: Path, context: typer.Context) -> "Recording | Readings":
    """Return the recording in a file, or else the readings that are asked for."""
    from neurosnap.apps.export.relations import open_data

    with progress("reading"):
        return open_data(data, _wanted(context))


def _wanted(context: typer.Context) -> "Wanted":
    from neurosnap.sources.conditions import parse_condition, parse_span
    from neurosnap.sources.wanted import Wanted

    given = context.params
    conditions = tuple(map(parse_condition, given["when"] or ()))
    names, time, bins = tuple(given["sensors"] or ()), given["time"], given["bins"]
    every = parse_span(given["period"], "every")
    return Wanted(names, conditions, time, bins, every)
