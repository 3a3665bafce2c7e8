"""``neurosnap depth``: how far waves of messages travel, and how long that takes."""

import asyncio
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    Force,
    Format,
    end_by,
    errors,
    run_async,
    unwinding,
)
from neurosnap.apps.cli.run_flags import options_of, with_parameters
from neurosnap.apps.cli.terminal_output import print_facts, progress, say, table, warn
from neurosnap.apps.new_files import free_path
from neurosnap.depth.probe import Measured, Sweep
from neurosnap.errors import InvalidValueError, NeurosnapError, NothingBegunError
from neurosnap.poc.order.graph import BEYOND_HEIGHT
from neurosnap.system.picture import KINDS

if TYPE_CHECKING:
    from neurosnap.depth.measure import FittedLine

_SWEEP = options_of(Sweep)
Out = Annotated[
    Path,
    typer.Option(
        "--out",
        "-o",
        metavar="DIR",
        help="The folder for depth.csv and its picture, as .png, .svg and .pdf.",
    ),
]


@app.command()
@with_parameters(**{name: (o.kind, o.parameter(name)) for name, o in _SWEEP.items()})
def depth(
    context: typer.Context,
    log: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LOG]",
            help="Measure the waves in this recording, and start no swarm.",
        ),
    ] = None,
    heights: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="How long the chains of implications are, one after another.",
        ),
    ] = "1,2,4,8,16,32,64",
    sensors: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="How many sensors the swarms have, one after another.",
            show_default="what the longest chain takes, and twice as many",
        ),
    ] = "",
    out: Out = Path(),
    force: Force = False,
    form: Format = "text",
) -> None:
    """Measure how far a wave of messages travels, and how long that takes.

    Starts swarms whose implications form chains; writes a table and a picture.
    """
    from neurosnap.depth.measure import fit, from_recording, write_all
    from neurosnap.recording.read.recording import Recording

    with errors():
        given = {name: context.params[name] for name in _SWEEP}
        tall, sizes = _numbers("heights", heights), _numbers("sensors", sensors or "0")
        sweep = Sweep(heights=tall, sensors=sizes if sensors else (), **given)
        recording = None if log is None else Recording.open(log)
        if out.is_dir():
            free_path(out / "depth.csv", force=force)
        rows = _swept(sweep) if recording is None else from_recording(recording)
        if not rows:
            raise NeurosnapError("depth: must have a wave to measure, got none")
        out.mkdir(parents=True, exist_ok=True)
        with unwinding():
            source = "swarms of given orders" if log is None else log.name
            wrote, lacking = write_all(rows, out, source)
        if lacking:
            warn(f"no picture: {lacking}")
        line, files = fit(rows), {path.suffix[1:]: str(path) for path in wrote}
        say(form, *_lines(rows, line), f"wrote {', '.join(files.values())}")
        paths = {kind: files.get(kind) for kind in ("csv", *KINDS)}
        print_facts(form, {**paths, "waves": len(rows), "line": line, "rows": rows})
        if recording is not None:
            end_by(recording)


def _swept(sweep: Sweep) -> list[Measured]:
    """Start the swarms, and return what was measured."""
    from neurosnap.depth.measure import measure

    with progress("waves", sweep.total) as on_progress:

        async def work(stop: asyncio.Event) -> list[Measured]:
            found = await measure(sweep, stop, on_progress)
            if not found and stop.is_set():
                rule = "must measure a wave, was asked to end first"
                raise NothingBegunError(f"depth: {rule}")
            return found

        return run_async(work)


def _lines(rows: Sequence[Measured], line: "FittedLine | None") -> Iterator[str]:
    """Yield depth and time by height."""
    groups: dict[tuple[int, str, int], list[Measured]] = {}
    for row in rows:
        groups.setdefault((row.sensors, row.kind, row.height), []).append(row)
    shown = [("sensors", "kind", "height", "waves", "depth", "pulses", "median ms")]
    for (sensors, kind, height), found in sorted(groups.items()):
        times = sorted(row.seconds for row in found)
        shown.append(
            (
                str(sensors),
                f"{kind}, {found[0].wiring}",
                str(height),
                str(len(found)),
                _span([row.depth for row in found]),
                _span([row.pulses for row in found]),
                f"{1e3 * times[len(times) // 2]:.2f}",
            )
        )
    yield from table(shown, numbers=True)
    most = BEYOND_HEIGHT
    beyond = [row.depth - row.height for row in rows if row.depth > row.height]
    more = f"up to {max(beyond)} more in {len(beyond)}" if beyond else "more in none"
    rule = f"allowed: {most} hops more where sensors are equal"
    yield f"depth: at most the height in {len(rows) - len(beyond)} waves, {more} ({rule})"
    if line is not None:
        yield f"time over depth: {line.words}"


def _span(values: Sequence[int]) -> str:
    least, most = min(values), max(values)
    return str(least) if least == most else f"{least}–{most}"


def _numbers(name: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidValueError(name, "must be whole numbers", text) from error
