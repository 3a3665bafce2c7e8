"""``neurosnap replay``: verifies, plays back or resumes a recording."""

import asyncio
import os
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import FLAG, NETWORK, option
from neurosnap.apps.cli.shared import (
    LOST,
    Json,
    Log,
    app,
    convert,
    end_by,
    errors,
    new_log,
    print_json,
    run_async,
    say,
    screen,
    was_given,
)
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.runtime.network import Network

_ONLY_WITH = {"begin": "verify", "ticks": "resume", "out": "resume"}
"""Flags, and what they go with."""
_ONLY_PLAYING = ("rate", "start", "step", "listen", "tls", "insecure")


@app.command(epilog="Example: neurosnap replay a.mcap --verify")
def replay(
    context: typer.Context,
    log: Log,
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            metavar=FLAG,
            help="Compute every state and decision again from the recorded observations,"
            " and compare bit for bit with what was recorded.",
        ),
    ] = False,
    rate: Annotated[
        float,
        typer.Option(help="Play this many times as fast as it was recorded."),
    ] = 1.0,
    begin: Annotated[
        int,
        typer.Option(
            "--from",
            metavar="TICK",
            help="With --verify: skip what comes before the last key-frame up to this"
            " tick.",
        ),
    ] = 0,
    start: Annotated[
        int, typer.Option(metavar="TICK", help="The first tick to play.")
    ] = 1,
    step: Annotated[
        bool,
        typer.Option("--step", metavar=FLAG, help="Wait for Enter before each tick."),
    ] = False,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where programs connect to hear what is played.",
        ),
    ] = "tcp/127.0.0.1:7447",
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            metavar=FLAG,
            help="Go on with the run after its last whole tick, into a new recording.",
        ),
    ] = False,
    ticks: Annotated[
        int | None,
        typer.Option(
            help="With --resume: how many ticks there are to be in all.",
            show_default="300 more than there are",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap",
            help="With --resume: where to record; must not exist yet.",
            show_default="logs/SOURCE-DATE.mcap",
        ),
    ] = None,
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    as_json: Json = False,
) -> None:
    """Verify a recording, play it back over Zenoh, or go on with its run.

    Without --verify and --resume it is played back.
    """
    with errors():
        if verify and resume:
            raise InvalidValueError("replay", "must verify or resume", "both")
        _check_flags(context)
        if verify:
            _verify(log, begin, as_json)
        elif resume:
            _resume(log, ticks, out, as_json)
        else:
            network = convert(Network, listen=listen, tls=tls, insecure=insecure)
            _play(log, rate, start, step, network, as_json)


def _check_flags(context: typer.Context) -> None:
    """Refuse a flag that what is done has no use for."""
    given = context.params
    playing = not (given["verify"] or given["resume"])
    for flag, what in _ONLY_WITH.items():
        if was_given(context, flag) and not given[what]:
            name = "from" if flag == "begin" else flag
            raise InvalidValueError(name, f"must come with --{what}", given[flag])
    for flag in _ONLY_PLAYING:
        if was_given(context, flag) and not playing:
            rule = "must come without --verify and --resume"
            raise InvalidValueError(flag, rule, given[flag])


def _verify(log: Path, begin: int, as_json: bool) -> None:
    from neurosnap.apps.cli import output
    from neurosnap.recording.replay.verify import verify

    verdict = verify(log, begin)
    if verdict.same and not verdict.ticks:
        behind = f" behind tick {verdict.start}" if verdict.start else ""
        rule = f"must hold a whole tick{behind} to be verified"
        raise RecordingError(f"{log}: {rule}, got none")
    output.verdict(say(as_json), verdict)
    if as_json:
        print_json(msgspec.structs.asdict(verdict))
    if not verdict.same:
        raise typer.Exit(1)
    if not verdict.complete:
        raise typer.Exit(LOST)


def _resume(log: Path, ticks: int | None, out: Path | None, as_json: bool) -> None:
    from neurosnap.apps.cli import output
    from neurosnap.recording.read.recording import part_path
    from neurosnap.recording.replay.resume import find_resume_point
    from neurosnap.runtime.request import RunRequest
    from neurosnap.runtime.run import run as run_swarm
    from neurosnap.sources.open import open_source

    options, past = find_resume_point(log)
    source = open_source(options.source, options.seed, options.arguments)
    source.close()
    most = past.tick + 300 if ticks is None else ticks
    if source.length is not None:
        most = min(most, source.length)
    if most <= past.tick:
        rule = f"must be more than the {past.tick} there are, and the source have them"
        raise InvalidValueError("ticks", rule, most)
    options = msgspec.structs.replace(options, ticks=most)
    new = new_log(options.source, out)
    request = RunRequest(options, new, past)
    with output.progress(screen, "ticks", options.ticks) as on_tick:
        watcher = output.watcher(screen, on_tick)
        outcome = run_async(lambda stop: run_swarm(request, stop, watcher))
    written = part_path(new, past.part)
    output.outcome(say(as_json), options, outcome, written)
    if as_json:
        facts = output.outcome_facts(options, outcome, written)
        print_json({**facts, "resumed": str(log), "resumed_at": past.tick})
    whole = outcome.completeness is None or outcome.completeness.whole
    if outcome.lost or not whole:
        raise typer.Exit(LOST)


def _play(
    log: Path, rate: float, start: int, step: bool, network: Network, as_json: bool
) -> None:
    from neurosnap.apps.cli import output
    from neurosnap.apps.cli.recording_info import shown
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.playback import play_on

    network.check()
    recording = Recording.open(log)
    where = f"{network.listen} under neurosnap/{shown(recording.swarm)}/**"

    def on_begin() -> None:
        screen.print(f"playing on {where}", markup=False)

    with output.progress(screen, "tick", None) as on_progress:
        played = run_async(
            lambda stop: play_on(
                recording,
                network.listen,
                stop,
                rate=rate,
                start=start,
                step=_asking(stop) if step else None,
                on_begin=on_begin,
                on_progress=on_progress,
                credentials=network.credentials("hub"),
                insecure=network.insecure,
            )
        )
    say(as_json).print(
        f"played {played.ticks} ticks, {played.messages} messages"
        f" in {played.seconds:.1f} s"
    )
    if as_json:
        print_json(msgspec.structs.asdict(played))
    end_by(recording)


def _asking(stop: asyncio.Event) -> Callable[[int], Awaitable[bool]]:
    """Return what asks for Enter before a tick."""

    async def ask(tick: int) -> bool:
        screen.print(f"tick {tick}: Enter plays it", end=" ")
        return await _wait_enter(stop)

    return ask


async def _wait_enter(stop: asyncio.Event) -> bool:
    """Wait for Enter; false at the end of the input, or once `stop` is set.

    Not in a thread, since one that waits for a key cannot be told to stop.
    """
    loop, wake = asyncio.get_running_loop(), asyncio.Event()
    try:
        loop.add_reader(descriptor := sys.stdin.fileno(), wake.set)
    except OSError:  # neither a terminal nor a pipe: it keeps nobody waiting
        return bool(sys.stdin.readline())
    stopping = asyncio.create_task(stop.wait(), name="cli/stop")
    stopping.add_done_callback(lambda _: wake.set())
    try:
        while True:
            await wake.wait()
            wake.clear()
            if stop.is_set():
                return False
            key = os.read(descriptor, 1)  # past any buffer, which would hide the rest
            if key in (b"\n", b""):
                return key == b"\n"
    finally:
        stopping.cancel()
        loop.remove_reader(descriptor)
