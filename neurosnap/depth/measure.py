"""Measures propagation depth against order height, live or from a recording.

The claim to look at: with a cell a sensor, the time to propagate grows with the height
of the order and not with the number of sensors.
"""

import asyncio
import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.depth.probe import Measured, ProbeJob, Sweep
from neurosnap.errors import MissingExtraError, RecordingError
from neurosnap.poc.order.graph import BEYOND_HEIGHT
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.compilation import compile_first
from neurosnap.runtime.launch import Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher
from neurosnap.system.durable import replace_file, replacing
from neurosnap.system.picture import KINDS, MANY, MARKERS, canvas_type, encoded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = ("sensors", "wiring", "height", "depth", "longest", "pulses", "seconds")


class FittedLine(msgspec.Struct, frozen=True):
    """A fitted line: seconds of a wave over its depth."""

    slope: float
    """Seconds a hop."""
    intercept: float
    """Seconds a wave takes without hops."""
    r2: float
    """The share of the variance it explains, in [0, 1]."""

    @property
    def explains(self) -> bool:
        """It explains half of the variance; below that its slope means little."""
        return self.r2 >= 0.5

    @property
    def words(self) -> str:
        """What it says, in words."""
        slope = f"{1e6 * self.slope:.0f} µs a hop" if self.explains else "no line fits"
        return f"{slope}, R² {self.r2:.3f}"


async def measure(
    sweep: Sweep,
    stop: asyncio.Event,
    on_progress: Callable[[int], None] = lambda _: None,
) -> list[Measured]:
    """Time waves through swarms wired to orders of given heights.

    What was measured by `stop` is returned; `on_progress` is called with the number of
    waves that are timed.

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


def write_all(
    rows: Sequence[Measured], folder: Path, source: str
) -> tuple[list[Path], str]:
    """Write the table and its picture; return what was written, and what is lacking."""
    write_csv(rows, table := folder / "depth.csv")
    try:
        return [table, *draw(rows, folder, source)], ""
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


def draw(rows: Sequence[Measured], folder: Path, source: str) -> list[Path]:
    """Write ``depth.png``, ``.svg`` and ``.pdf``: depth over height, time over depth.

    Return what was written. `source` is what the waves are of.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = canvas_type("depth.png")(figsize=(11, 5.6), layout="constrained")
    figure.suptitle(f"{len(rows)} waves of {source}")
    left, right = figure.subplots(1, 2)
    # State waves come first, so that both kinds look as they do on the page.
    groups = sorted({(r.kind != "state", r.sensors, r.wiring) for r in rows})
    for number, group in enumerate(groups, groups[0][0] if groups else 0):
        chosen = [r for r in rows if (r.kind != "state", r.sensors, r.wiring) == group]
        label = (
            f"{chosen[0].kind} waves, {group[1]} cells, {group[2]}, n = {len(chosen)}"
        )
        colour, marker = MANY[number % len(MANY)], MARKERS[number % len(MARKERS)]
        look: dict[str, Any] = {"color": colour, "marker": marker, "alpha": 0.5}
        _draw_depths(left, chosen, {**look, "label": label})
        if group[0]:  # of state waves it says how many cells there are
            _draw_times(right, chosen, {**look, "label": label})
    _draw_bound(left, max((max(row.height, row.depth) for row in rows), default=1))
    left.set(xlabel="height (edges on the longest chain)", ylabel="depth (hops)")
    right.set(xlabel="depth (hops)", ylabel="time of a wave (ms)")
    left.set_title("How deep waves travel: bars are medians and quartiles")
    right.set_title("How long they take")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:  # there may be no signal waves
            axes.legend(fontsize="small")
    paths = [folder / f"depth.{kind}" for kind in KINDS]
    for path, kind in zip(paths, KINDS, strict=True):
        replace_file(path, encoded(figure, kind))
    return paths


def _draw_depths(axes: "Axes", rows: Sequence[Measured], look: dict[str, Any]) -> None:
    """Draw a dot a pair of height and depth, and the quartiles of each height."""
    pairs = np.array([(row.height, row.depth) for row in rows])
    places, counts = np.unique(pairs, axis=0, return_counts=True)
    # The larger a dot, the more waves of that height and depth.
    sizes = 12 + 150 * counts / counts.max()
    axes.scatter(places[:, 0], places[:, 1], s=sizes, **look)
    for height in np.unique(places[:, 0]):
        depths = pairs[pairs[:, 0] == height, 1]
        low, middle, high = np.percentile(depths, (25, 50, 75))
        spread, colour = [[middle - low], [high - middle]], look["color"]
        axes.errorbar(height, middle, spread, fmt="_", ms=12, capsize=3, color=colour)


def _draw_bound(axes: "Axes", reach: int) -> None:
    """Draw how deep a wave may go at each height, on square axes."""
    ends, most = np.array([0, reach]), reach + BEYOND_HEIGHT
    band: dict[str, Any] = {"color": "0.88", "zorder": 0}
    axes.plot(ends, ends, color="0.4", lw=1, ls="--", label="depth = height")
    label = f"{BEYOND_HEIGHT} hops more: sensors are equal"
    axes.fill_between(ends, ends, ends + BEYOND_HEIGHT, label=label, **band)
    axes.set(xlim=(-0.5, most + 0.5), ylim=(-0.5, most + 0.5), aspect="equal")


def _draw_times(axes: "Axes", rows: Sequence[Measured], look: dict[str, Any]) -> None:
    """Draw a dot a wave, and the fitted line if it explains what they take."""
    depths = np.array([row.depth for row in rows])
    line = fit(rows)
    if line is not None:
        look["label"] += f": {line.words}"
    axes.scatter(depths, [1e3 * row.seconds for row in rows], s=10, **look)
    if line is not None and line.explains:
        ends = np.array([depths.min(), depths.max()])
        fitted = 1e3 * (line.intercept + line.slope * ends)
        axes.plot(ends, fitted, color=look["color"])
