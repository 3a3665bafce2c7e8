"""Measures propagation depth against order height, live or from a recording.

The claim to look at: with a cell a sensor, the time to propagate grows with the height
of the order and not with the number of sensors.
"""

import asyncio
import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.depth.probe import Measured, ProbeJob, Sweep
from neurosnap.errors import MissingExtraError, RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.compilation import compile_first
from neurosnap.runtime.launch import Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher
from neurosnap.system.durable import replace_file, replacing
from neurosnap.system.picture import KINDS, MANY, MARKERS, canvas_type, encoded

COLUMNS = ("sensors", "wiring", "height", "depth", "longest", "pulses", "seconds")


class FittedLine(msgspec.Struct, frozen=True):
    """A fitted line: seconds of a wave over its depth."""

    slope: float
    """Seconds a hop."""
    intercept: float
    """Seconds a wave takes without hops."""
    r2: float
    """The share of the variance it explains, in [0, 1]."""


async def measure(
    sweep: Sweep,
    stop: asyncio.Event,
    on_progress: Callable[[int], None] = lambda _: None,
) -> list[Measured]:
    """Time waves through swarms wired to orders of given heights.

    Args:
        sweep: Which.
        stop: Ends it; what was measured by then is returned.
        on_progress: Called with the number of waves that are timed.

    Raises:
        SwarmError: A part failed.
    """
    rows: list[Measured] = []
    if sweep.cells == "worker":
        await compile_first(None, stop)
    for count in sweep.sizes:
        if stop.is_set():
            break
        hosts = host_jobs(count, sweep.sharing)
        jobs = Jobs(partial(ProbeJob, sweep, count), hosts)

        def report(waves: int, before: int = len(rows)) -> None:
            on_progress(before + waves)

        ending = await launch(jobs, Site(), stop, Watcher(report))
        rows += msgspec.json.decode(ending.result, type=list[Measured])
    return rows


def from_recording(recording: Recording) -> list[Measured]:
    """Return a row for every wave of a recorded run that has settled.

    Its time is the coordinator's: from the wave's start to its result.

    Raises:
        RecordingError: The recording is not a run's, or lacks the start of a wave whose
            result it holds, though it is not damaged.
    """
    options = recording.options
    damage = recording.damage
    started: dict[int, int] = {}
    rows = []
    for recorded in recording.messages(("wavestart", "state", "reached")):
        match recorded.message:
            case wire.WaveStart(wave=wave):
                started.setdefault(wave, recorded.sent)
            case wire.State() | wire.Reached() as result:
                if result.wave not in started:
                    if damage:
                        continue
                    where = f"{recording.path}: wave {result.wave}"
                    raise RecordingError(f"{where}: must have its start, got none")
                rows.append(
                    Measured(
                        sensors=len(options.sensors),
                        wiring=options.wiring,
                        height=result.height,
                        depth=result.depth,
                        longest=result.longest,
                        pulses=result.pulses,
                        seconds=(recorded.sent - started.pop(result.wave)) / 1e9,
                        kind="state" if isinstance(result, wire.State) else "signal",
                    )
                )
            case _:
                pass
    return rows


def fit(rows: Iterable[Measured]) -> FittedLine | None:
    """Fit seconds over depth by least squares; None for fewer than two depths.

    State waves are left out: they fire in every cell at once, and what they take says
    how many cells there are.
    """
    points = [(row.depth, row.seconds) for row in rows if row.kind == "signal"]
    if len({depth for depth, _ in points}) < 2:
        return None
    x, y = np.array(points, dtype=np.float64).T
    slope, intercept = np.polyfit(x, y, 1)
    spread = float(((y - y.mean()) ** 2).sum())
    left = float(((y - slope * x - intercept) ** 2).sum())
    r2 = 1.0 - left / spread if spread > 0 else 1.0
    return FittedLine(float(slope), float(intercept), r2)


def write_all(rows: Sequence[Measured], folder: Path) -> tuple[list[Path], str]:
    """Write the table and its picture; return what was written, and what is lacking."""
    write_csv(rows, table := folder / "depth.csv")
    try:
        return [table, *draw(rows, folder)], ""
    except MissingExtraError as error:
        return [table], str(error)


def write_csv(rows: Iterable[Measured], path: Path) -> None:
    """Write ``depth.csv``: one row a wave, whole or not at all."""
    with (
        replacing(path) as draft,
        draft.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows([getattr(row, name) for name in COLUMNS] for row in rows)


def draw(rows: Sequence[Measured], folder: Path) -> list[Path]:
    """Write ``depth.png``, ``.svg`` and ``.pdf``: depth over height, time over depth.

    State waves are not drawn; see `fit`.

    Returns:
        What was written.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = canvas_type("depth.png")(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    signals = [row for row in rows if row.kind == "signal"]
    groups = sorted({(row.sensors, row.wiring) for row in signals})
    for number, (sensors, wiring) in enumerate(groups):
        chosen = [r for r in signals if (r.sensors, r.wiring) == (sensors, wiring)]
        label = f"{sensors} cells, {wiring}"
        colour = MANY[number % len(MANY)]
        look: dict[str, Any] = {"c": colour, "marker": MARKERS[number % len(MARKERS)]}
        depths = np.array([row.depth for row in chosen])
        # Larger dots, more waves of that height and depth.
        pairs = np.stack([[row.height for row in chosen], depths], axis=1)
        places, counts = np.unique(pairs, axis=0, return_counts=True)
        sizes = 12 + 60 * counts / counts.max()
        left.scatter(*places.T, s=sizes, alpha=0.6, label=label, **look)
        times = [1e3 * row.seconds for row in chosen]
        right.scatter(depths, times, s=10, alpha=0.5, **look)
        if (line := fit(chosen)) is not None:
            ends = np.array([depths.min(), depths.max()])
            slope = f"{1e6 * line.slope:.0f} µs a hop, R² {line.r2:.3f}"
            fitted = 1e3 * (line.intercept + line.slope * ends)
            right.plot(ends, fitted, color=colour, label=f"{label}: {slope}")
    reach = max((max(row.height, row.depth) for row in rows), default=1)
    left.plot([0, reach], [0, reach], color="0.6", lw=1, ls="--", label="y = x")
    left.set(xlabel="height (edges on the longest chain)", ylabel="depth (hops)")
    right.set(xlabel="depth (hops)", ylabel="time of a wave (ms)")
    left.set_title("How deep waves travel")
    right.set_title("How long they take")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:  # a single depth makes no line
            axes.legend(fontsize="small")
    paths = [folder / f"depth.{kind}" for kind in KINDS]
    for path, kind in zip(paths, KINDS, strict=True):
        replace_file(path, encoded(figure, kind))
    return paths
