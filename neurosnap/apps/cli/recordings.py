"""``neurosnap info``, ``verify``, ``play`` and ``export``, which read a recording."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    LOST,
    Force,
    Format,
    Log,
    convert,
    end_by,
    errors,
    run_async,
    unwinding,
)
from neurosnap.apps.cli.run_flags import NETWORK, option, settings
from neurosnap.apps.cli.terminal_output import (
    in_ranges,
    print_facts,
    printable,
    progress,
    say,
    warn,
)
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.runtime.network import Network
from neurosnap.system.compiled import interpreted

if TYPE_CHECKING:
    from neurosnap.recording.replay.verify import Verdict
    from neurosnap.recording.write.copying import Salvaged


@app.command()
def info(log: Log, form: Format = "text") -> None:
    """Show what a recording holds, and what is missing from it.

    Of messages of another program (.mcap) it shows topics and fields, what these say,
    and what sensors they give by themselves.
    """
    from neurosnap.apps.cli.recording_info import describe, messages_of, render
    from neurosnap.recording.read.recording import Recording
    from neurosnap.sources.bag_records import is_bag
    from neurosnap.sources.mcap_file import describe_mcap

    with errors():
        if log.exists() and is_bag(str(log)):
            topics, fields = describe_mcap(str(log))
            say(form, *messages_of(topics, fields))
            rows = [[each._asdict() for each in some] for some in (topics, fields)]
            print_facts(form, {"topics": rows[0], "fields": rows[1]})
            return
        recording = Recording.open_file(log)
        found = describe(recording)
        say(form, *render(found))
        print_facts(form, found)
        if found.damage or found.lost or not recording.whole:
            raise typer.Exit(LOST)


@app.command(epilog="Example: neurosnap verify a.mcap")
def verify(
    log: Log,
    begin: Annotated[
        int,
        typer.Option(
            "--from",
            metavar="TICK",
            help="Skip what comes before the last key-frame up to this tick.",
        ),
    ] = 0,
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Derive it under another option instead, such as"
            " snapshot.threshold=auto: one of agent, snapshot, anomalies or health in"
            " the TOML file. May be repeated.",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Derive a run again from its observations, and compare bit for bit.

    Every state and every decision is computed from what was observed, and compared with
    what was recorded.

    With --set it says at which ticks states, decisions, anomalies and alarms would have
    been others. The readings and the actions taken stay as recorded: a decision is what
    the agent would have decided there.
    """
    from neurosnap.recording.replay import verify as replayed

    with errors():
        if given:
            if begin:
                raise InvalidValueError("from", "must go without --set", begin)
            _report_departures(log, settings(given), form)
            return
        verdict = replayed.verify(log, begin)
        if verdict.same and not verdict.ticks:
            behind = f" behind tick {verdict.start}" if verdict.start else ""
            rule = f"must hold a whole tick{behind} to be verified"
            raise RecordingError(f"{log}: {rule}, got none")
        say(form, *_verdict_lines(verdict))
        print_facts(form, verdict)
        if not verdict.same:
            raise typer.Exit(1)
        if not verdict.complete:
            raise typer.Exit(LOST)


def _report_departures(log: Path, given: dict[str, object], form: str) -> None:
    """Say where a run departs from its recording under other options."""
    from neurosnap.apps.config.prepare import other_options
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.verify import departures

    recording, ticks = Recording.open(log), 0
    differ = dict.fromkeys(("states", "decisions", "anomalies", "alarms"), 0)
    first: dict[str, tuple[int, str]] = {}
    options = other_options(recording.options, given)
    for ticks, each in enumerate(departures(recording, options), start=1):
        for kind, line in each.items():
            differ[kind] += 1
            first.setdefault(kind, (ticks, line))
    if not ticks:
        raise RecordingError(f"{log}: must hold a whole tick to be derived, got none")
    for kind, (tick, line) in first.items():
        where = f"at {differ[kind]} of {ticks} ticks, first at tick {tick}"
        say(form, printable(f"different: {kind} {where}: {line}"))
    if same := [kind for kind, count in differ.items() if not count]:
        say(form, f"same: {', '.join(same)} of {ticks} ticks")
    facts = {"same": not first, "complete": recording.whole, "ticks": ticks}
    print_facts(form, {**facts, "differ": differ, "first": first})
    if first:
        raise typer.Exit(1)
    end_by(recording)


def _verdict_lines(found: "Verdict") -> Iterator[str]:
    """Yield what a replay found."""
    if not found.same:
        yield f"different: {found.difference}"
        return
    since = f" after tick {found.start}" if found.start else ""
    if found.missing:
        since = f" ({in_ranges(found.ranges)})"
    where = f" in {found.files} files" if found.files > 1 else ""
    # The last tick's is left out, unless the run was only asked to end after it.
    one_more = found.decisions > found.states
    before = ", since a start makes one, too" if one_more else ""
    yield (
        f"same: every state and decision of {found.ticks} ticks{since}{where} came out"
        f" the same ({found.states} states, {found.decisions} decisions{before},"
        f" {found.wirings} wirings, {found.waves} waves; {found.seconds:.2f} s)"
    )
    if found.missing:
        yield f"missing: ticks {in_ranges(found.missing)}"
    yield from (f"damaged: {line}" for line in found.damage)
    if not found.complete:
        yield "the recording is incomplete"


@app.command()
def play(
    log: Log,
    rate: Annotated[
        float,
        typer.Option(help="Play this many times as fast as it was recorded."),
    ] = 1.0,
    start: Annotated[
        int, typer.Option("--from", metavar="TICK", help="The first tick to play.")
    ] = 1,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where the hub listens, for programs that connect to receive it.",
        ),
    ] = "tcp/127.0.0.1:7447",
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    form: Format = "text",
) -> None:
    """Publish a recording over Zenoh again, as it was when it was recorded."""
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.playback import Playing, play_on

    with errors():
        network = convert(Network, listen=listen, tls=tls, insecure=insecure)
        network.check()
        recording = Recording.open(log)

        async def begin() -> None:
            swarm = printable(recording.swarm)
            warn(f"playing on {network.listen} under neurosnap/{swarm}/**")

        credentials = network.credentials("hub")
        with progress("tick") as on_progress:
            playing = Playing(rate, start, begin, on_progress)
            played = run_async(
                lambda stop: play_on(
                    recording,
                    listen,
                    stop,
                    playing,
                    credentials=credentials,
                    insecure=insecure,
                )
            )
        count = f"{played.ticks} ticks, {played.messages} messages"
        say(form, f"played {count} in {played.seconds:.1f} s")
        print_facts(form, played)
        end_by(recording)


@app.command()
def export(
    log: Log,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Where to write; must not exist yet. Its ending says what: .csv or"
            " .parquet: a table with a row for each tick. .html: the page of `neurosnap"
            " view`, which opens anywhere. .mcap: all that is intact of a damaged"
            " recording. .rosbag2: a folder, which `ros2 bag` plays.",
            show_default="a .csv beside the recording",
        ),
    ] = None,
    force: Force = False,
    form: Format = "text",
) -> None:
    """Convert a recording to a table, a page or a bag, or save what is intact of it."""
    from neurosnap.apps.export.table import export as write
    from neurosnap.apps.viewer.page_file import write_page
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.write.copying import salvage

    with errors():
        path = log.with_suffix(".csv") if out is None else out
        ending = path.suffix.lower()
        if force and ending in (".mcap", ".rosbag2"):
            raise InvalidValueError("out", "must come without --force", str(path))
        if ending == ".mcap":
            with unwinding():
                _report_salvaged(salvage(log, path), form)
            return
        recording = Recording.open(log)
        if ending == ".html":
            with unwinding(), interpreted(recording.options.briefly):
                write_page(log, path, force=force)
            size = path.stat().st_size
            say(form, f"wrote {path} ({size / 1e6:.2f} MB), which opens in a browser")
            print_facts(form, {"path": str(path), "bytes": size})
            end_by(recording)
            return
        with unwinding():
            if ending == ".rosbag2":
                from neurosnap.apps.export.rosbag2 import write_bag

                found = write_bag(recording, path)
            else:
                found = write(recording, path, force=force)
        say(form, f"wrote {path}")
        if found.incomplete:
            say(form, f"{found.incomplete} ticks lack something")
        print_facts(form, found)
        end_by(recording)


def _report_salvaged(found: "Salvaged", form: str) -> None:
    kept, missing = found.completeness.messages, found.completeness.missing
    lacks = f", {sum(missing.values())} are missing" if missing else ""
    say(form, *(f"lost: {line}" for line in found.lost))
    say(form, f"wrote {found.path}: {kept} messages{lacks}")
    print_facts(form, found)
    if found.lost or missing:
        raise typer.Exit(LOST)
