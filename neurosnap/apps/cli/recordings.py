"""``neurosnap info``, ``verify``, ``play`` and ``export``, all of a recording."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli import output
from neurosnap.apps.cli.options import FLAG, NETWORK, option
from neurosnap.apps.cli.shared import (
    LOST,
    RECORDINGS,
    Force,
    Format,
    Log,
    OptionalTick,
    app,
    convert,
    end_by,
    errors,
    people,
    print_facts,
    run_async,
    screen,
    unwinding,
)
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.runtime.network import Network

if TYPE_CHECKING:
    from neurosnap.apps.export.write import Exported
    from neurosnap.recording.write.copying import Salvaged


@app.command(rich_help_panel=RECORDINGS)
def info(log: Log, form: Format = "text") -> None:
    """Show what a recording holds, what it learned, and what is missing from it."""
    from neurosnap.apps.cli.recording_info import describe, render
    from neurosnap.apps.cli.relations import learned_lines
    from neurosnap.recording.read.recording import Recording

    with errors():
        recording = Recording.open_file(log)
        found = describe(recording)
        for line in (*learned_lines(log, recording, found), render(found)):
            people(form).print(line, markup=False, soft_wrap=True)
        print_facts(form, found)
        if not recording.whole:
            raise typer.Exit(LOST)


@app.command(epilog="Example: neurosnap verify a.mcap", rich_help_panel=RECORDINGS)
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
    form: Format = "text",
) -> None:
    """Derive a run again from its observations, and compare bit for bit.

    Every state and every decision is computed from what was observed, and compared with
    what was recorded.
    """
    from neurosnap.recording.replay import verify as replayed

    with errors():
        verdict = replayed.verify(log, begin)
        if verdict.same and not verdict.ticks:
            behind = f" behind tick {verdict.start}" if verdict.start else ""
            rule = f"must hold a whole tick{behind} to be verified"
            raise RecordingError(f"{log}: {rule}, got none")
        output.verdict(people(form), verdict)
        print_facts(form, msgspec.structs.asdict(verdict))
        if not verdict.same:
            raise typer.Exit(1)
        if not verdict.complete:
            raise typer.Exit(LOST)


@app.command(rich_help_panel=RECORDINGS)
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
    from neurosnap.apps.cli.recording_info import shown
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.playback import Playing, play_on

    with errors():
        network = convert(Network, listen=listen, tls=tls, insecure=insecure)
        network.check()
        recording = Recording.open(log)
        where = f"{network.listen} under neurosnap/{shown(recording.swarm)}/**"

        async def begin() -> None:
            screen.print(f"playing on {where}", markup=False)

        with output.progress(screen, "tick", None) as on_progress:
            played = run_async(
                lambda stop: play_on(
                    recording,
                    network.listen,
                    stop,
                    Playing(rate, start, begin, on_progress),
                    credentials=network.credentials("hub"),
                    insecure=network.insecure,
                )
            )
        people(form).print(
            f"played {played.ticks} ticks, {played.messages} messages"
            f" in {played.seconds:.1f} s"
        )
        print_facts(form, msgspec.structs.asdict(played))
        end_by(recording)


@app.command(rich_help_panel=RECORDINGS)
def export(
    log: Log,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Where to write; must not exist yet. Its ending says what: .csv or"
            " .parquet: a table with a row for each tick. .graphml: the implications"
            " that were learned. .mcap: all that is intact of a damaged recording.",
            show_default="a .csv beside the recording",
        ),
    ] = None,
    at: OptionalTick = None,
    only_readings: Annotated[
        bool,
        typer.Option(
            "--only-readings",
            metavar=FLAG,
            help="With .csv: the time and the sensors only, a file that `neurosnap run`"
            " takes.",
        ),
    ] = False,
    force: Force = False,
    form: Format = "text",
) -> None:
    """Convert a recording to a table or a graph, or save what is intact of it."""
    from neurosnap.apps.export.write import export as write
    from neurosnap.apps.export.write import form_of
    from neurosnap.recording.write.copying import salvage

    with errors():
        kind = "csv" if out is None else form_of(out)
        if out is not None and kind is None:
            if force or at is not None or only_readings:
                rule = "must come without --at, --only-readings and --force"
                raise InvalidValueError("out", rule, str(out))
            _show_saved(salvage(log, out), form)
        else:
            with unwinding():
                exported = write(
                    log,
                    kind or "csv",
                    out,
                    at=at,
                    only_readings=only_readings,
                    force=force,
                )
            _show_exported(exported, form)


def _show_exported(found: "Exported", form: str) -> None:
    people(form).print(f"wrote {found.path}", markup=False, soft_wrap=True)
    if found.incomplete:
        people(form).print(f"{found.incomplete} ticks lack something")
    if not found.whole:
        for line in found.damage:
            screen.print(f"damaged: {line}", markup=False, soft_wrap=True)
        screen.print("the recording is not whole: wrote what there is")
    print_facts(form, found)
    if not found.whole:
        raise typer.Exit(LOST)


def _show_saved(found: "Salvaged", form: str) -> None:
    for line in found.lost:
        people(form).print(f"lost: {line}", markup=False, soft_wrap=True)
    kept, missing = found.completeness.messages, found.completeness.missing
    lacks = f", {sum(missing.values())} are missing" if missing else ""
    text = f"wrote {found.path}: {kept} messages{lacks}"
    people(form).print(text, markup=False, soft_wrap=True)
    print_facts(form, found)
    if found.lost or missing:
        raise typer.Exit(LOST)
