"""Measures what a tick costs each part, and fits the model in docs/scale.md.

Walkers on lines are recorded and judged, with their cells in workers. What is measured
is processor time: unlike seconds it adds up, and what else runs on the machine hardly
changes it. A part is taken to spend so much a tick, so much a sensor, so much more in
an anomaly, and so much a pair of sensors that were told apart. These are found at some
sizes, and what they say of others is held against runs.
"""

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.request import Watcher
from tests.support.swarm_processes import parts_of
from tools.bench.report import Line, Sizes
from tools.bench.run import line_options, run_once

_WORKERS = 2
_BEGIN, _TICKS = 32, 160  # several blocks of 64 observations lie between
_READINGS = (
    60_000  # few sensors are quick: more ticks, for the parts are not looked at often
)
_PARTS = ("coordinator", "worker", "recorder", "hub")
_ERROR = 0.1
_LARGE, _LEAST, _MOST_MEMORY = 10_000, {0: 15, 3: 8}, 2


class Cost(NamedTuple):
    """What a run's ticks took."""

    terms: NDArray[np.float64]
    """``(4,)``: a tick, a thousand sensors, as many in an anomaly, a million pairs that
    were told apart."""
    spent: Mapping[str, float]
    """Processor seconds a tick of each part; of workers, of one of them."""


def scale(sizes: Sizes) -> list[Line]:
    """Find what a tick costs each part, and what that says of other sizes."""
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        every = _costs([*sizes.fitted, *sizes.foretold], Path(name))
    fitted, held = every[: len(sizes.fitted)], every[len(sizes.fitted) :]
    model = {part: _constants(fitted, part) for part in _PARTS}
    errors = [abs(_said(cost, model) / _was(cost) - 1) for cost in held]
    mean = float(np.mean(errors))
    return [
        *(_of_part(part, model[part]) for part in _PARTS),
        *(
            _foretold(size, cost, model)
            for size, cost in zip(sizes.foretold, held, strict=True)
        ),
        Line(
            "the model's error: mean",
            f"{mean:.0%}, at most {max(errors):.0%}",
            reach=f"≤ {_ERROR:.0%}",
            reached=mean <= _ERROR,
            figures={"mean": mean, "most": max(errors)},
        ),
    ]


def large(sizes: Sizes) -> list[Line]:
    """Time runs of many sensors, of which none or three read wrong at every tick."""
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        return [
            _pace(count, wrong, Path(name)) for count in sizes.paces for wrong in (0, 3)
        ]


def _pace(count: int, wrong: int, folder: Path) -> Line:
    """Run a walk in two workers, recorded and judged."""
    options, log = _options(count, _TICKS, folder, wrong=wrong), folder / "run.mcap"
    spent = Spent(_BEGIN, every=16, weighs=True)
    made = run_once(options, log, Watcher(spent.look))
    log.unlink()
    pace, gigabytes, least = spent.pace, spent.memory / 1e9, _LEAST[wrong]
    return Line(
        f"a walk of {count:,} sensors in {_WORKERS} workers, {wrong} bits wrong a tick",
        f"{pace:.1f} ticks/s, {gigabytes:.1f} GB",
        f"{made.totals.anomalies} anomalies in {made.totals.ticks} ticks",
        f"≥ {least} at {_LARGE:,}, ≤ {_MOST_MEMORY} GB",
        None if count != _LARGE else pace >= least and gigabytes <= _MOST_MEMORY,
        {"pace": pace, "gigabytes": gigabytes},
    )


class Spent:
    """What each kind of part has spent, at some of a run's ticks.

    Args:
        begin: The first tick to look at: all parts are up by then.
        every: Ticks from one look to the next, at least.
        weighs: Whether to look at the memory, which takes a hundred times as long.
    """

    def __init__(self, begin: int, every: int = 0, weighs: bool = False) -> None:
        self._begin = begin
        self._every = every
        self._weighs = weighs
        self._parts = 0
        self._seen: list[tuple[int, float, Counter[str]]] = []
        self.memory = 0  # bytes of all parts at most; what they share counts once

    def look(self, tick: int) -> None:
        """Look at the parts that this process has started, unless some have ended."""
        if tick < self._begin:
            return
        spent: Counter[str] = Counter()
        found, memory = [*parts_of(psutil.Process())], 0
        for who, process in found:
            try:
                times = process.cpu_times()
                memory += process.memory_full_info().pss if self._weighs else 0
            except psutil.NoSuchProcess:
                return
            spent[who.partition("/")[0]] += times.user + times.system
        self._parts = self._parts or len(found)
        if len(found) == self._parts:
            self._seen.append((tick, time.monotonic(), spent))
            self._begin = tick + self._every
            self.memory = max(self.memory, memory)

    @property
    def pace(self) -> float:
        """Ticks a second, between first and last look."""
        (first, began, _), (last, ended, _) = self._seen[0], self._seen[-1]
        return (last - first) / (ended - began)

    def a_tick(self, least: int) -> dict[str, float]:
        """Return the seconds a tick of each kind of part, between first and last look.

        Args:
            least: Ticks that must lie between them.
        """
        (first, _, before), (last, _, after) = self._seen[0], self._seen[-1]
        if last - first < least:
            raise RuntimeError(f"ticks {first} to {last}: must be {least} at least")
        return {part: (after[part] - before[part]) / (last - first) for part in after}


def _options(
    count: int, ticks: int, folder: Path, walkers: int = 1, wrong: int = 0
) -> RunOptions:
    return replace(
        line_options(count, ticks, folder, walkers, wrong),
        cells="worker",
        workers=_WORKERS,
        watch=True,
        keyframe_every=1 << 20,
    )


def _costs(sizes: Sequence[tuple[int, int]], folder: Path) -> list[Cost]:
    """Return what a tick took at some sizes, of two runs each, there and back.

    So it does not matter if the machine slows down meanwhile.
    """
    there = [_cost(size, folder) for size in sizes]
    back = [_cost(size, folder) for size in reversed(sizes)]
    return [
        one._replace(
            spent={who: (one.spent[who] + other.spent[who]) / 2 for who in _PARTS}
        )
        for one, other in zip(there, reversed(back), strict=True)
    ]


def _cost(size: tuple[int, int], folder: Path) -> Cost:
    """Return what a tick took in a run of so many sensors and walkers."""
    count, walkers = size
    at, ticks = folder / f"{count}", max(_TICKS, _READINGS // count)
    at.mkdir()
    spent, options = Spent(_BEGIN), _options(count, ticks, at, walkers)
    made = run_once(options, at / "run.mcap", Watcher(spent.look))
    found = spent.a_tick(ticks // 2)
    apart = len(np.unique(_readings(at / "run.mcap"), axis=1).T)
    shutil.rmtree(at)
    odd = made.totals.anomalies / made.totals.ticks
    pairs = apart * (apart - 1) / 2e6
    terms = np.array([1.0, count / 1e3, odd * count / 1e3, pairs])
    return Cost(terms, found | {"worker": found["worker"] / _WORKERS})


def _readings(log: Path) -> NDArray[np.uint8]:
    """Return ``(T, N)``, what was observed."""
    rows = (
        np.unpackbits(np.frombuffer(each.bits, np.uint8), bitorder="little")
        for each in Recording.open(log).all("observation", wire.Observation)
    )
    return np.array([*rows])


def _constants(costs: Sequence[Cost], part: str) -> NDArray[np.float64]:
    """Return ``(4,)``, none below 0: with the least sum of squared relative errors."""
    every = np.array([cost.terms / cost.spent[part] for cost in costs])
    best, least = np.zeros(every.shape[1]), np.inf
    for use in product((False, True), repeat=every.shape[1]):
        found = np.zeros(every.shape[1])
        found[[*use]] = np.linalg.lstsq(every[:, [*use]], np.ones(len(costs)))[0]
        error = float(((every @ found - 1) ** 2).sum())
        if (found >= 0).all() and error < least:
            best, least = found, error
    return best


def _of_part(part: str, model: NDArray[np.float64]) -> Line:
    once, sensor, odd, apart = model.tolist()
    return Line(
        f"a tick of the {part}",
        f"{once * 1e3:.1f} ms + {sensor * 1e3:.2f} µs a sensor"
        f" + {odd * 1e3:.2f} in an anomaly"
        f" + {apart * 1e3:.2f} ns a pair told apart",
        figures={
            "once": once,
            "sensor": sensor * 1e-3,
            "anomaly": odd * 1e-3,
            "apart": apart * 1e-6,
        },
    )


def _said(cost: Cost, model: Mapping[str, NDArray[np.float64]]) -> float:
    """Return the seconds a tick that a model says of all parts."""
    return sum(_several(part) * float(model[part] @ cost.terms) for part in _PARTS)


def _was(cost: Cost) -> float:
    """Return the seconds a tick of all parts."""
    return sum(_several(part) * cost.spent[part] for part in _PARTS)


def _several(part: str) -> int:
    return _WORKERS if part == "worker" else 1


def _foretold(
    size: tuple[int, int], cost: Cost, model: Mapping[str, NDArray[np.float64]]
) -> Line:
    """Hold what the model says of a size against what was spent."""
    shown = []
    for part in _PARTS:  # each in milliseconds
        several = 1e3 * _several(part)
        foretold = several * float(model[part] @ cost.terms)
        shown.append(f"{part} {foretold:.1f} and {several * cost.spent[part]:.1f}")
    said, was = _said(cost, model), _was(cost)
    count, walkers = size
    return Line(
        f"a tick of {count:,} sensors, {walkers} walkers: foretold and measured",
        f"{said * 1e3:.1f} and {was * 1e3:.1f} ms ({said / was - 1:+.0%})",
        f"{', '.join(shown)} ms",
        figures={"foretold": said, "measured": was},
    )
