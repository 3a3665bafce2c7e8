"""Terminal output: progress, tables and summaries."""

from __future__ import annotations

import shlex
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import msgspec
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from neurosnap.health.news import Newsreader
from neurosnap.protocol.anomaly_messages import few
from neurosnap.runtime.request import Restart, Watcher
from neurosnap.sensorium import visible
from neurosnap.system.picture import KINDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from rich.console import Console

    from neurosnap.agent.growth.changed import Changed
    from neurosnap.apps.doctor import Finding
    from neurosnap.depth.measure import FittedLine
    from neurosnap.depth.probe import Measured
    from neurosnap.health.news import Standing
    from neurosnap.protocol.coordinator import Totals
    from neurosnap.protocol.run_options import RunOptions
    from neurosnap.recording.replay.verify import Verdict
    from neurosnap.runtime.registry import Note, Part
    from neurosnap.runtime.request import Outcome

_MOST = 24  # implications shown; all of them are in `neurosnap learn`


@contextmanager
def progress(screen: Console, what: str, total: int | None) -> Iterator[OnProgress]:
    """Show a bar that follows the number the callback is told, and the total."""
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


class OnProgress(Protocol):
    """Told how much is done, and where that is not known beforehand, of how much."""

    def __call__(self, done: int, of: int | None = None) -> None:
        """Show it."""


def outcome_facts(
    options: RunOptions, outcome: Outcome, log: Path | None
) -> dict[str, object]:
    """Return a run's outcome as one JSON object."""
    return {
        "log": None if log is None else str(log),
        "cells": len(options.sensors),
        **msgspec.structs.asdict(outcome.totals),
        "seconds": outcome.seconds,
        "startup": outcome.startup,
        "restarts": outcome.restarts,
        "stopped": outcome.stopped,
        "complete": outcome.complete,
        "kept": outcome.kept,
        "journal": outcome.journal,
        "waiting": outcome.waiting,
        "lost": outcome.lost,
        "health": None if outcome.health is None else health_facts(outcome.health),
        "implications": outcome.implications,
    }


def health_facts(standing: Standing) -> dict[str, object]:
    """Return how the sensors of a home are as one JSON object."""
    alarms = [
        {**msgspec.structs.asdict(alarm), "line": alarm.line()}
        for alarm in standing.alarms
    ]
    return {"progress": msgspec.structs.asdict(standing.progress), "alarms": alarms}


def watcher(console: Console, on_tick: Callable[[int], None]) -> Watcher:
    """Return what prints a run's restarts, changes and news of health."""
    reader = Newsreader()

    def on_change(change: Changed) -> None:
        _plain(console, changed_line(change))

    def on_health(standing: Standing) -> None:
        for line in reader.lines(standing):
            _plain(console, visible(line))

    def on_restart(event: Restart) -> None:
        restart(console, event)

    return Watcher(on_tick, on_change, on_health, on_restart)


def _plain(console: Console, line: str) -> None:
    """Print a line as it is."""
    console.print(line, markup=False, highlight=False, soft_wrap=True)


def restart(console: Console, event: Restart) -> None:
    """Say that a run goes on, what that costs, and what it could not go on from."""
    what = "readings are lost" if event.outside else "ticks are done again"
    cost = f"; {event.lost} {what}" if event.lost else ""
    console.print(
        f"[yellow]going on[/yellow] from tick {event.tick}: {escape(event.why)}{cost}",
        soft_wrap=True,
    )
    for path in event.kept:
        console.print(
            f"[red]could not go on from[/red] a recording; kept: {escape(path)}",
            soft_wrap=True,
        )


def swarms(console: Console, notes: Sequence[Note]) -> None:
    """List the swarms that run."""
    if not notes:
        console.print("no swarm runs here")
        return
    table = Table("swarm", "pid", "source", "recording", box=None, pad_edge=False)
    for note in notes:
        table.add_row(note.swarm, str(note.pid), escape(note.source), escape(note.log))
    console.print(table)


def parts(console: Console, note: Note, there: Sequence[Part]) -> None:
    """List the processes of one swarm."""
    console.print(f"swarm {note.swarm}: {note.source}, hub at {note.endpoint}")
    table = Table("part", "pid", "memory", "processor", box=None, pad_edge=False)
    for part in there:
        memory = f"{part.memory / 2**20:.0f} MB"
        table.add_row(part.who, str(part.pid), memory, f"{part.seconds:.2f} s")
    console.print(table)


def outcome(
    console: Console, options: RunOptions, outcome_: Outcome, log: Path | None
) -> None:
    """Print a run's summary."""
    totals = outcome_.totals
    rate = totals.ticks / outcome_.seconds if outcome_.seconds > 0 else 0.0
    in_workers = options.cells == "worker"
    kind = f"{options.sharing} workers" if in_workers else options.cells
    rows = {
        "cells": f"{len(options.sensors)} ({kind}, {options.wiring} wiring)",
        "ticks": f"{totals.ticks} in {outcome_.seconds:.1f} s ({rate:.0f} a second)",
        "waves": f"{totals.waves}",
        "pulses": f"{totals.pulses}",
        "depth": f"{totals.depth} hops, the deepest wave",
        "height": f"{totals.height}, the longest chain of implications now",
        "incoherent": f"{totals.incoherent} observations",
        **(
            {"anomalies": _anomalies_text(totals, options.support)}
            if options.watch
            else {}
        ),
        "implications": f"{totals.edges}",
    }
    if room := options.body.room:
        left = room - totals.grown
        rows["grown"] = grown_text(totals.grown, totals.retired, left)
    if totals.faults:
        rows["faults"] = f"{totals.faults} messages dropped as bad or unexpected"
    if outcome_.restarts:
        rows["restarts"] = f"{outcome_.restarts}, after a part had died"
    table = Table(box=None, show_header=False, pad_edge=False)
    for name, value in rows.items():
        table.add_row(f"[bold]{name}[/bold]", value)
    console.print(table)
    _implications(console, outcome_.implications, log)
    if (health := outcome_.health) is not None:
        _plain(console, health.progress.line())
        for alarm in health.alarms:
            _plain(console, visible(f"in alarm: {alarm.line()}"))
    if outcome_.stopped:
        console.print(f"stopped after tick {totals.ticks}, as asked")
    if log is not None:
        console.print(f"recording: {escape(str(log))}", soft_wrap=True)
    if outcome_.lost:
        rule = "came in and had no tick, or were no readings"
        console.print(f"[red]{outcome_.lost} lines or messages {rule}[/red]")
    if outcome_.waiting:
        kept = f"{outcome_.waiting} readings came in and had no tick; they are kept in"
        then = "and are taken in when the run is resumed"
        console.print(f"{kept} {escape(outcome_.journal)} {then}", soft_wrap=True)
    elif outcome_.journal:
        kept = "the readings that the recording may lack are kept in"
        console.print(f"{kept} {escape(outcome_.journal)}", soft_wrap=True)
    _losses(console, outcome_)


def _losses(console: Console, outcome_: Outcome) -> None:
    """Say what the recording lacks, and what of it may be unreadable."""
    balance = outcome_.completeness
    if balance is not None and balance.missing:
        lost = [f"{count} of {who}" for who, count in balance.missing.items()]
        console.print(
            f"[red]the recording lacks {sum(balance.missing.values())} messages[/red]:"
            f" {escape(few(lost))}",
            soft_wrap=True,
        )
    if balance is not None and balance.gaps:
        where = "where the one that it goes on from was damaged"
        console.print(f"[red]the recording lacks messages[/red] {where}")
    for path in () if balance is None else balance.vanished:
        text = "deleted, moved or replaced while it was written"
        console.print(f"[red]{text}[/red]: {escape(path)}", soft_wrap=True)
    for path in outcome_.kept:
        text = "may hold ticks that cannot be read"
        console.print(f"[red]damaged[/red]: {escape(path)} {text}", soft_wrap=True)


def _anomalies_text(totals: Totals, support: int) -> str:
    every = f"{totals.anomalies} observations against what was learned"
    if not support or totals.told == totals.anomalies:
        return every
    return f"{totals.told} reported, of {every}"


def _implications(
    console: Console, pairs: Sequence[tuple[str, str]], log: Path | None
) -> None:
    shown = ", ".join(f"{below} → {above}" for below, above in pairs[:_MOST])
    if pairs:
        console.print(f"  {escape(visible(shown))}")
    more = f"and {len(pairs) - _MOST} more; " if len(pairs) > _MOST else ""
    if pairs and log is not None:
        table = f"with tests and failures: neurosnap learn {shlex.quote(str(log))}"
        console.print(f"  {more}{table}", markup=False, soft_wrap=True)
    elif more:  # there is no recording to ask later
        console.print(f"  {more}all: --format json")


def verdict(console: Console, found: Verdict) -> None:
    """Print what a replay found."""
    if not found.same:
        console.print("[red]different[/red]:", escape(str(found.difference)))
        return
    since = f" after tick {found.start}" if found.start else ""
    if found.missing:
        since = f" ({in_ranges(found.ranges)})"
    where = f" in {found.files} files" if found.files > 1 else ""
    # The last tick's is left out, unless the run was only asked to end after it.
    one_more = found.decisions > found.states
    before = ", since a start makes one, too" if one_more else ""
    console.print(
        f"same: every state and decision of {found.ticks} ticks{since}{where} came out"
        f" the same ({found.states} states, {found.decisions} decisions{before},"
        f" {found.wirings} wirings, {found.waves} waves; {found.seconds:.2f} s)"
    )
    if found.missing:
        lost = in_ranges(found.missing)
        console.print(f"[yellow]missing[/yellow]: ticks {lost}", soft_wrap=True)
    for line in found.damage:
        console.print(f"[yellow]damaged[/yellow]: {escape(line)}", soft_wrap=True)
    if not found.complete:
        console.print("[yellow]the recording is incomplete[/yellow]")


def depth_facts(
    rows: Sequence[Measured], line: FittedLine | None, wrote: Sequence[Path]
) -> dict[str, object]:
    """Return what was measured as one JSON object, with the files by their kind."""
    files = {path.suffix: str(path) for path in wrote}
    return {
        "csv": files.get(".csv"),
        **{kind: files.get(f".{kind}") for kind in KINDS},
        "waves": len(rows),
        "line": None if line is None else msgspec.structs.asdict(line),
        "rows": [msgspec.structs.asdict(row) for row in rows],
    }


def depths(
    console: Console,
    rows: Sequence[Measured],
    line: FittedLine | None,
    wrote: Sequence[Path],
) -> None:
    """Print depth and time by height."""
    table = Table("sensors", "kind", "height", "waves", "depth", "pulses", "median ms")
    groups: dict[tuple[int, str, int], list[Measured]] = {}
    for row in rows:
        groups.setdefault((row.sensors, row.kind, row.height), []).append(row)
    for (sensors, kind, height), found in sorted(groups.items()):
        times = sorted(row.seconds for row in found)
        table.add_row(
            str(sensors),
            f"{kind}, {found[0].wiring}",
            str(height),
            str(len(found)),
            _span([row.depth for row in found]),
            _span([row.pulses for row in found]),
            f"{1e3 * times[len(times) // 2]:.2f}",
        )
    console.print(table)
    if line is not None:
        console.print(
            f"time over depth: {1e6 * line.slope:.0f} µs a hop, R² {line.r2:.3f}"
        )
    console.print(f"wrote {', '.join(escape(str(path)) for path in wrote)}")


def _span(values: Sequence[int]) -> str:
    least, most = min(values), max(values)
    return str(least) if least == most else f"{least}–{most}"


def findings(console: Console, found: Sequence[Finding]) -> None:
    """Print what the doctor found, each with how to fix it."""
    for finding in found:
        mark = "[green]ok[/green] " if finding.ok else "[red]bad[/red]"
        console.print(f"{mark} {escape(finding.what)}: {escape(finding.found)}")
        if not finding.ok:
            console.print(f"    → {escape(finding.fix)}")


def in_ranges(ranges: Iterable[tuple[int, int]]) -> str:
    """Return ranges of ticks as text: "3, 5..8"."""
    return ", ".join(
        f"{first}..{last}" if last > first else str(first) for first, last in ranges
    )


def changed_line(changed: Changed) -> str:
    """Return what is said when a sensor is grown, or read no more.

    Example:
        >>> from neurosnap.agent.growth.changed import Changed
        >>> changed_line(Changed(tick=83, sensor=24, name="press&a&b", retires=False))
        'tick 83: grew press&a&b'
    """
    what = "retired" if changed.retires else "grew"
    return visible(f"tick {changed.tick}: {what} {changed.name}")


def grown_text(grown: int, retired: int, room: int) -> str:
    """Return how many sensors were grown, and how many may be.

    Example:
        >>> grown_text(3, 1, 17), grown_text(0, 0, 20), grown_text(1, 0, 0)
        ('3, 1 of them retired; room for 17 more', 'none; room for 20 more', \
'1; no room for more')
    """
    gone = f", {retired} of them retired" if retired else ""
    left = f"room for {room} more" if room else "no room for more"
    return f"{grown or 'none'}{gone}; {left}"
