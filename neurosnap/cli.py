"""The command line: parses, calls, prints. What it prints last with --json is JSON.

Exit codes: 0 all well, 1 failed, 2 wrong usage, 3 finished but something was lost.
"""

import asyncio
import math
import os
import signal
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Annotated, NoReturn, TypeVar

import msgspec
import typer
from rich.console import Console

from neurosnap.agent.policy import EXPLORE, AgentKind
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.source import Argument
from neurosnap.swarm.options import CellKind, RunOptions, SnapshotKind, WiringKind

T = TypeVar("T")

LOST = 3

app = typer.Typer(
    name="neurosnap",
    help="A snapshot memory whose sensors are processes that compute by messages.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
screen = Console(stderr=True, highlight=False)

Log = Annotated[Path, typer.Argument(metavar="LOG", help="A recording (.mcap).")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object last.")]
OptionalTick = Annotated[
    int | None, typer.Option(metavar="TICK", help="As it was after this tick.")
]


@app.command()
def run(
    source: Annotated[
        str, typer.Argument(help="A world's id (neurosnap/Path-v0) or a CSV file.")
    ],
    ticks: Annotated[
        int | None,
        typer.Option(help="Observations to take. [default: 300, or a whole CSV]"),
    ] = None,
    seed: Annotated[int, typer.Option(help="Draws all that is random.")] = 0,
    agent: Annotated[AgentKind, typer.Option(help="Who decides.")] = "walker",
    target: Annotated[
        str | None,
        typer.Option(
            help="What a planner wants to sense (below_5,below_4*), or the place an"
            " excited agent is drawn to. [default: for excited, drawn by the seed]"
        ),
    ] = None,
    explore: Annotated[
        float, typer.Option(help="Share of random actions, in [0, 1].")
    ] = EXPLORE,
    given: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="An argument of the world."),
    ] = None,
    snapshot: Annotated[
        SnapshotKind, typer.Option(help="How weights are learned.")
    ] = "empirical",
    threshold: Annotated[
        float | None, typer.Option(help="Learning threshold, in (0, 0.25].")
    ] = None,
    decay: Annotated[
        float | None, typer.Option(help="Decay of a discounted snapshot, in [0, 1).")
    ] = None,
    wiring: Annotated[
        WiringKind, typer.Option(help="Which edges carry pulses.")
    ] = "hasse",
    cells: Annotated[
        CellKind, typer.Option(help="One OS process a cell, or all in this one.")
    ] = "process",
    out: Annotated[
        Path | None, typer.Option(help="Where to record. [default: logs/…]")
    ] = None,
    record: Annotated[bool, typer.Option(help="Record at all.")] = True,
    deadline: Annotated[float, typer.Option(help="Seconds a wave may take.")] = 10.0,
    as_json: Json = False,
) -> None:
    """Run a source through a swarm of cells and record everything."""
    from neurosnap import show
    from neurosnap.source import open_source
    from neurosnap.swarm.embody import body_of, drawn_to
    from neurosnap.swarm.run import run as run_swarm

    with _errors():
        arguments = _arguments(given or [])
        wanted: tuple[str, ...] = ()
        if agent == "excited":
            arguments |= drawn_to(source, seed, arguments, target)
        elif target is not None:
            wanted = tuple(name.strip() for name in target.split(","))
        opened = open_source(source, seed, arguments)
        opened.close()
        options = _options(
            source=source,
            arguments=arguments,
            body=body_of(opened, agent),
            agent=agent,
            target=wanted,
            explore=explore,
            ticks=_ticks(ticks, opened.length),
            seed=seed,
            snapshot=snapshot,
            threshold=threshold,
            decay=decay,
            wiring=wiring,
            cells=cells,
            deadline=deadline,
        )
        log = _new_log(source, out) if record else None
        with show.progress(screen, "ticks", options.ticks) as on_progress:
            outcome = _run(lambda stop: run_swarm(options, log, stop, on_progress))
        show.outcome(_say(as_json), options, outcome, log)
        if as_json:
            _print_json(show.outcome_facts(options, outcome, log))
        if outcome.completeness is not None and not outcome.completeness.whole:
            raise typer.Exit(LOST)


@app.command()
def replay(
    log: Log,
    verify: Annotated[
        bool, typer.Option("--verify", help="Derive all again, and compare.")
    ] = False,
    rate: Annotated[
        float, typer.Option(help="Play back at this many times the speed.")
    ] = 1.0,
    start: Annotated[
        int, typer.Option(metavar="TICK", help="Play back from this tick on.")
    ] = 1,
    step: Annotated[
        bool, typer.Option("--step", help="Play back a tick for each Enter.")
    ] = False,
    listen: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="Where to play back.")
    ] = "tcp/127.0.0.1:7447",
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last whole tick.")
    ] = False,
    ticks: Annotated[
        int | None, typer.Option(help="With --resume: ticks in all. [default: +300]")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="With --resume: where to record.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Verify a recording, play it back over Zenoh, or go on with its run."""
    with _errors():
        if verify and resume:
            raise InvalidValueError("replay", "must verify or resume", "both")
        if verify:
            _verify(log, as_json)
        elif resume:
            _resume(log, ticks, out, as_json)
        else:
            _play(log, rate, start, step, listen, as_json)


def _verify(log: Path, as_json: bool) -> None:
    from neurosnap import show
    from neurosnap.record.replay import verify

    verdict = verify(log)
    show.verdict(_say(as_json), verdict)
    if as_json:
        _print_json(msgspec.structs.asdict(verdict))
    if not verdict.same:
        raise typer.Exit(1)
    if not verdict.complete:
        raise typer.Exit(LOST)


def _resume(log: Path, ticks: int | None, out: Path | None, as_json: bool) -> None:
    from neurosnap import show
    from neurosnap.record.resume import look_back
    from neurosnap.source import open_source
    from neurosnap.swarm.run import run as run_swarm

    options, past = look_back(log)
    source = open_source(options.source, options.seed, options.arguments)
    source.close()
    most = _ticks(past.tick + 300 if ticks is None else ticks, source.length)
    if most <= past.tick:
        rule = f"must be more than the {past.tick} there are, and the source have them"
        raise InvalidValueError("ticks", rule, most)
    options = msgspec.structs.replace(options, ticks=most)
    new = _new_log(options.source, out)
    with show.progress(screen, "ticks", options.ticks) as on_progress:
        outcome = _run(lambda stop: run_swarm(options, new, stop, on_progress, past))
    show.outcome(_say(as_json), options, outcome, new)
    if as_json:
        facts = show.outcome_facts(options, outcome, new)
        _print_json({**facts, "resumed": str(log), "resumed_at": past.tick})
    if outcome.completeness is not None and not outcome.completeness.whole:
        raise typer.Exit(LOST)


def _play(
    log: Path, rate: float, start: int, step: bool, listen: str, as_json: bool
) -> None:
    from neurosnap import show
    from neurosnap.record.playback import play_on
    from neurosnap.record.reader import Recording

    recording = Recording.open(log)
    screen.print(f"playing on {listen} under neurosnap/{recording.swarm}/**")
    with show.progress(screen, "tick", None) as on_progress:
        played = _run(
            lambda stop: play_on(
                recording,
                listen,
                stop,
                rate=rate,
                start=start,
                step=_asking(stop) if step else None,
                on_progress=on_progress,
            )
        )
    _say(as_json).print(
        f"played {played.ticks} ticks, {played.messages} messages"
        f" in {played.seconds:.1f} s"
    )
    if as_json:
        _print_json(msgspec.structs.asdict(played))
    if not recording.finished:
        raise typer.Exit(LOST)


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


@app.command()
def info(log: Log, as_json: Json = False) -> None:
    """Say what is in a recording, cut short or not."""
    from neurosnap.record.info import describe, render
    from neurosnap.record.reader import Recording

    with _errors():
        found = describe(Recording.open(log))
        _say(as_json).print(render(found), markup=False, soft_wrap=True)
        if as_json:
            _print_json(msgspec.to_builtins(found))


@app.command()
def graph(
    log: Log,
    at: OptionalTick = None,
    form: Annotated[
        str, typer.Option("--format", help="json, dot or graphml.")
    ] = "json",
    as_json: Json = False,
) -> None:
    """Print the implications learned, by name."""
    from neurosnap.diagram import diagram, parse_format, render
    from neurosnap.record.history import snapshot_at
    from neurosnap.record.reader import Recording

    with _errors():
        wanted = parse_format("json" if as_json else form)
        tick, snapshot = snapshot_at(Recording.open(log), at)
        drawn = diagram(tick, snapshot.poc_graph(), snapshot.sensorium)
        if as_json:
            _print_json(msgspec.to_builtins(drawn))
        else:
            typer.echo(render(drawn, wanted))


@app.command()
def depth(
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", help="Measure this recording instead."),
    ] = None,
    heights: Annotated[
        str, typer.Option(help="Heights of the chains, with commas.")
    ] = "1,2,4,8,16,32,64",
    wiring: Annotated[
        WiringKind, typer.Option(help="Which edges carry pulses.")
    ] = "hasse",
    sensors: Annotated[
        str, typer.Option(help="Cells in each swarm. [default: 1 and 2 × the tallest]")
    ] = "",
    waves: Annotated[int, typer.Option(help="Waves at each height.")] = 10,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write.")] = Path(),
    as_json: Json = False,
) -> None:
    """Measure how deep waves travel against the height of the order."""
    from neurosnap import show
    from neurosnap.depth import draw, fit, from_recording, measure, write_csv
    from neurosnap.record.reader import Recording

    with _errors():
        tall = _numbers("heights", heights)
        sizes = _numbers("sensors", sensors) if sensors else _sizes(tall)
        if log is not None:
            rows = from_recording(Recording.open(log))
        else:
            total = len(sizes) * len(tall) * waves
            with show.progress(screen, "waves", total) as on_progress:
                rows = _run(
                    lambda stop: measure(tall, wiring, sizes, waves, stop, on_progress)
                )
        if not rows:
            raise NeurosnapError("depth: must have a wave to measure, got none")
        out.mkdir(parents=True, exist_ok=True)
        write_csv(rows, out / "depth.csv")
        draw(rows, out / "depth.png")
        line = fit(rows)
        show.depths(_say(as_json), rows, line, out)
        if as_json:
            _print_json(show.depth_facts(rows, line, out))


@app.command()
def model(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|LOG|EXPR",
            help='A named model (--list), a recording, or "a, b : a < b*".',
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Where to draw. [default: NAME.png]"),
    ] = None,
    at: OptionalTick = None,
    limit: Annotated[
        int, typer.Option(help="The most vertices of a dual to draw.")
    ] = 256,
    names: Annotated[bool, typer.Option("--list", help="List the names.")] = False,
    as_json: Json = False,
) -> None:
    """Draw a poc set and its dual: of the paper, of a recording, or your own."""
    from neurosnap.picture.find import find, listed
    from neurosnap.picture.numbers import in_words, measure
    from neurosnap.picture.page import draw_model

    with _errors():
        if names:
            for name, title in listed().items():
                _say(as_json).print(f"{name:24} {title}", markup=False, soft_wrap=True)
            if as_json:
                _print_json({"models": listed()})
            return
        if what is None:
            rule = "must be a name of --list, a recording or an expression"
            raise InvalidValueError("model", rule, "nothing")
        found = find(what, at, limit)
        path = Path(f"{found.name}.png") if out is None else out
        numbers = measure(found)
        draw_model(found, numbers, path)
        for line in (numbers.title, *in_words(numbers), f"wrote {path}"):
            _say(as_json).print(line, markup=False, soft_wrap=True)
        if as_json:
            _print_json({"png": str(path), **msgspec.to_builtins(numbers)})


@app.command()
def doctor(as_json: Json = False) -> None:
    """Look for what would keep a swarm from running here, and how to mend it."""
    from neurosnap import show
    from neurosnap.doctor import examine

    with _errors():
        findings = examine()
        show.findings(_say(as_json), findings)
        if as_json:
            _print_json({"findings": msgspec.to_builtins(findings)})
        if not all(finding.ok for finding in findings):
            raise typer.Exit(1)


# What the verbs share -----------------------------------------------------------------


@contextmanager
def _errors() -> Iterator[None]:
    """Turn our errors into one line and an exit code."""
    try:
        yield
    except InvalidValueError as error:
        _fail(str(error), 2)
    except NeurosnapError as error:
        _fail(str(error), 1)
    except OSError as error:
        _fail(f"{error.filename or 'system'}: {error.strerror or error}", 1)


def _fail(text: str, code: int) -> NoReturn:
    screen.print(f"[red]error:[/red] {_plain(text)}", soft_wrap=True)
    raise typer.Exit(code)


def _plain(text: str) -> str:
    """Keep rich from reading brackets in somebody's text as its own."""
    return text.replace("[", r"\[")


def _say(as_json: bool) -> Console:
    """Return where people are told: not where the JSON goes."""
    return screen if as_json else Console(highlight=False)


def _print_json(facts: object) -> None:
    typer.echo(msgspec.json.encode(facts).decode())


def _run(work: Callable[[asyncio.Event], Awaitable[T]]) -> T:
    """Run `work`; Ctrl-C or SIGTERM asks it to stop, a second one cancels it."""

    async def main() -> T:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        task = asyncio.current_task()

        def on_signal() -> None:
            if stop.is_set() and task is not None:
                task.cancel()
            stop.set()

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, on_signal)
        return await work(stop)

    try:
        return asyncio.run(main())
    except asyncio.CancelledError:
        _fail("interrupted before everything had ended in order", 1)


def _options(**given: object) -> RunOptions:
    """Return the options, checked: a wrong one is refused before anything starts."""
    try:
        options = msgspec.convert(given, RunOptions)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at ")
        name = place.strip("`$.") or "options"
        raise InvalidValueError(name, reason, given.get(name)) from error
    if math.isinf(options.deadline):  # JSON has no word for it
        raise InvalidValueError("deadline", "must be finite", options.deadline)
    options.new_snapshot()
    options.new_policy()
    return options


def _arguments(given: list[str]) -> dict[str, Argument]:
    """Return the world's arguments: JSON's numbers, true, false; anything else text."""
    arguments: dict[str, Argument] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidValueError("set", "must be NAME=VALUE", text)
        try:
            arguments[name] = msgspec.json.decode(value, type=Argument)
        except msgspec.DecodeError:
            arguments[name] = value
    return arguments


def _ticks(asked: int | None, length: int | None) -> int:
    """Return how many ticks to run: at most as many as the source has."""
    if length is None:
        return 300 if asked is None else asked
    return length if asked is None else min(asked, length)


def _new_log(source: str, out: Path | None) -> Path:
    """Return where to record: `out`, or a new name under ``logs/``."""
    if out is not None:
        if out.exists():
            raise InvalidValueError("out", "must not exist yet", str(out))
        if not out.absolute().parent.is_dir():
            raise InvalidValueError("out", "must be in a folder that exists", str(out))
        return out
    name = Path(source).stem.removesuffix("-v0").lower() or "run"
    folder = Path("logs")
    folder.mkdir(exist_ok=True)
    now = datetime.now().astimezone()
    return folder / f"{name}-{now:%Y%m%d-%H%M%S-%f}.mcap"


def _numbers(name: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidValueError(name, "must be whole numbers", text) from error


def _sizes(heights: tuple[int, ...]) -> tuple[int, ...]:
    """Return two swarm sizes: if only height counts, both take as long."""
    least = max(heights) + 1
    return (least, 2 * least)
