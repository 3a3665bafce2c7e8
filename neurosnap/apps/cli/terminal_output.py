"""Prints to the terminal: lines, tables, progress, the summary of a run."""

import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from neurosnap.health.alarm import Newsreader
from neurosnap.protocol.anomaly_report import anomaly_line, few
from neurosnap.runtime.request import Restart, Watcher
from neurosnap.sensorium import visible
from neurosnap.sources.live.statistics import received_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from neurosnap.agent.growth_in_decisions import Changed
    from neurosnap.apps.cli.run_at_a_glance import Glance
    from neurosnap.health.alarm import Standing
    from neurosnap.protocol.run_options import RunOptions
    from neurosnap.runtime.request import Outcome

_MOST = 24  # implications shown; all of them are in `neurosnap learn`

screen = Console(stderr=True, highlight=False)


def say(form: str, *lines: str) -> None:
    """Print lines of text: on standard output, or on standard error beside JSON."""
    for line in lines:
        if form == "json":
            warn(line)
        else:
            # Not by typer, which writes UTF-8 where the terminal has ASCII.
            sys.stdout.write(f"{line}\n")
            sys.stdout.flush()


def warn(*lines: str) -> None:
    """Print lines on standard error, above the progress bar if one is there."""
    # As they are: the text may hold what rich would read as markup.
    for line in lines:
        screen.print(line, markup=False, emoji=False, soft_wrap=True)


def print_facts(form: str, facts: object) -> None:
    """Print an object for programs, if that is the form that was asked for."""
    if form == "json":
        print_json(msgspec.to_builtins(facts, enc_hook=str))


def print_json(facts: object) -> None:
    """Print an object for programs, on one line."""
    typer.echo(msgspec.json.encode(facts))  # JSON is UTF-8, whatever a terminal is


def table(rows: Iterable[Sequence[str]], *, numbers: bool = False) -> Iterator[str]:
    """Lay out rows in columns as wide as their widest cell.

    Args:
        rows: As many cells in each.
        numbers: Set all but the first column to the right.

    Examples:
        >>> list(table([("name", "n"), ("a", "10")], numbers=True))
        ['name   n', 'a     10']
    """
    shown = [[printable(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for row in shown:
        cells = [
            cell.rjust(width) if numbers and place else cell.ljust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()


def fields(values: Mapping[str, object], indent: str = "") -> Iterator[str]:
    """Lay out names and values, one a line.

    Examples:
        >>> list(fields({"ticks": 7, "depth": 3}))
        ['ticks  7', 'depth  3']
    """
    return table((indent + name, str(value)) for name, value in values.items())


def printable(text: str) -> str:
    """Return text as it may go to a terminal: a stranger's file may steer one."""
    return visible(text) if text.isprintable() else repr(text)


@contextmanager
def progress(what: str, total: int | None = None) -> Iterator["Callable[..., None]"]:
    """Show a bar; yield what is called with how much is done, and of how much."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    hidden = not screen.is_terminal
    with Progress(*columns, console=screen, transient=True, disable=hidden) as bar:
        task = bar.add_task(what, total=total)

        def on_progress(done: int, of: int | None = None) -> None:
            bar.update(task, completed=done, total=total if of is None else of)

        yield on_progress


def outcome_facts(
    options: "RunOptions", outcome: "Outcome", log: Path | None
) -> dict[str, object]:
    """Return a run's outcome as one JSON object."""
    facts = msgspec.structs.asdict(outcome)
    totals, standing = facts.pop("totals"), facts.pop("health")
    del facts["completeness"], facts["intake"]
    return {
        "log": None if log is None else str(log),
        "cells": len(options.sensors),
        **msgspec.structs.asdict(totals),
        **facts,
        "readings": outcome.received,
        "complete": outcome.complete,
        "health": None if standing is None else health_facts(standing),
    }


def health_facts(standing: "Standing") -> dict[str, object]:
    """Return how the sensors of a home are as one JSON object."""
    alarms = [
        {**msgspec.structs.asdict(alarm), "line": alarm.line()}
        for alarm in standing.alarms
    ]
    return {"progress": msgspec.structs.asdict(standing.progress), "alarms": alarms}


def watcher(
    glance: "Glance", on_tick: "Callable[[int], None]" = lambda _: None
) -> Watcher:
    """Return the functions that print a run's restarts, changes and news of health.

    Args:
        glance: Is fed with the rest.
        on_tick: As in `Watcher`.
    """
    reader = Newsreader()
    return Watcher(
        on_tick,
        on_waves=glance.waves,
        on_presence=glance.presence,
        on_anomaly=lambda anomaly: glance.found(anomaly_line(anomaly)),
        on_change=lambda change: warn(changed_line(change)),
        on_health=lambda standing: warn(*map(visible, reader.lines(standing))),
        on_restart=lambda event: warn(*restart_lines(event)),
    )


def restart_lines(event: Restart) -> Iterator[str]:
    """Yield the lines about a restart: its cause, its cost, the recordings kept."""
    what = "readings are lost" if event.outside else "ticks are done again"
    cost = f"; {event.lost} {what}" if event.lost else ""
    yield f"going on from tick {event.tick}: {event.why}{cost}"
    for path, tick in event.kept:
        what = "could not go on from a recording"
        if tick:
            why = "later ones cannot be read or were observed otherwise"
            what = f"went on from tick {tick} of a recording, of which {why}"
        yield f"{what}; kept: {path}"


def outcome_lines(
    options: "RunOptions", outcome: "Outcome", log: Path | None
) -> Iterator[str]:
    """Yield a run's summary."""
    totals = outcome.totals
    made = totals.ticks - outcome.after
    rate = made / outcome.seconds if outcome.seconds > 0 else 0.0
    some = f", {made} of them" if outcome.after else ""
    in_workers = options.cells == "worker"
    kind = f"{options.sharing} workers" if in_workers else options.cells
    rows = {
        "cells": f"{len(options.sensors)} ({kind}, {options.wiring} wiring)",
        "ticks": f"{totals.ticks}{some} in {outcome.seconds:.1f} s ({rate:.0f} a second)",
        "waves": f"{totals.waves}",
        "pulses": f"{totals.pulses}",
        "depth": f"{totals.depth} hops, the deepest wave",
        "height": f"{totals.height}, the longest chain of implications now",
        "incoherent": f"{totals.incoherent} observations",
    }
    if options.watch:
        every = f"{totals.anomalies} observations against what was learned"
        all_told = not options.support or totals.told == totals.anomalies
        rows["anomalies"] = every if all_told else f"{totals.told} reported, of {every}"
    rows["implications"] = f"{totals.edges}"
    if room := options.body.room:
        left = room - totals.grown
        rows["grown"] = grown_text(totals.grown, totals.retired, left)
    if totals.faults:
        rows["faults"] = f"{totals.faults} messages dropped as bad or unexpected"
    if outcome.behind is not None:
        rows["behind"] = f"at tick {outcome.behind.tick} most: {outcome.behind.line()}"
    if outcome.restarts:
        rows["restarts"] = f"{outcome.restarts}, after a part had died"
    yield from fields(rows)
    yield from _implications(outcome.implications, log)
    if (health := outcome.health) is not None:
        yield health.progress.line()
        yield from (visible(f"in alarm: {alarm.line()}") for alarm in health.alarms)
    if outcome.stopped:
        yield f"stopped after tick {totals.ticks}, as asked"
    if log is not None:
        yield f"recording: {log}"
    yield from _losses(outcome)


def _losses(outcome: "Outcome") -> Iterator[str]:
    """Say what had no tick, what the recording lacks, and what may be unreadable."""
    if outcome.intake is not None:
        yield received_line(outcome.received)
        received = outcome.intake.received
        if received.outages:
            yield f"could not listen {received.outages} times: `neurosnap info` says when"
        if received.missing:
            yield f"{received.missing} readings are missing from a damaged journal"
    if outcome.waiting:
        yield (
            f"{outcome.waiting} readings are kept in {outcome.journal} and are taken in"
            " when the run is resumed"
        )
    elif outcome.journal:
        yield f"the readings that the recording may lack are kept in {outcome.journal}"
    if (balance := outcome.completeness) is not None:
        if balance.missing:
            lost = few([f"{count} of {who}" for who, count in balance.missing.items()])
            count = sum(balance.missing.values())
            yield f"the recording lacks {count} messages: {lost}"
        if balance.gaps:
            yield (
                "the recording lacks messages that no number shows: `neurosnap info`"
                " says where"
            )
        for path in balance.vanished:
            yield f"not left as it was written, or not taken by its disk: {path}"
    for path in outcome.kept:
        yield f"{path} may hold ticks that cannot be read or were observed otherwise"


def _implications(pairs: Sequence[tuple[str, str]], log: Path | None) -> Iterator[str]:
    if not pairs:
        return
    shown = ", ".join(f"{below} → {above}" for below, above in pairs[:_MOST])
    yield f"  {visible(shown)}"
    more = f"and {len(pairs) - _MOST} more; " if len(pairs) > _MOST else ""
    if log is not None:
        learn = f"neurosnap learn {shlex.quote(str(log))}"
        yield f"  {more}with tests and failures: {learn}"
    elif more:  # there is no recording to ask later
        yield f"  {more}all: --format json"


def in_ranges(ranges: Iterable[tuple[int, int]]) -> str:
    """Return ranges of ticks as text: "3, 5..8"."""
    return ", ".join(
        f"{first}..{last}" if last > first else str(first) for first, last in ranges
    )


def changed_line(changed: "Changed") -> str:
    """Return the line about a sensor that was grown or retired.

    Examples:
        >>> from neurosnap.agent.growth_in_decisions import Changed
        >>> changed_line(Changed(tick=83, sensor=24, name="press&a&b", retires=False))
        'tick 83: grew press&a&b'
    """
    what = "retired" if changed.retires else "grew"
    return visible(f"tick {changed.tick}: {what} {changed.name}")


def grown_text(grown: int, retired: int, room: int) -> str:
    """Return how many sensors were grown, and how many may be.

    Examples:
        >>> grown_text(3, 1, 17), grown_text(0, 0, 20), grown_text(1, 0, 0)
        ('3, 1 of them retired; room for 17 more', 'none; room for 20 more', \
'1; no room for more')
    """
    gone = f", {retired} of them retired" if retired else ""
    left = f"room for {room} more" if room else "no room for more"
    return f"{grown or 'none'}{gone}; {left}"
