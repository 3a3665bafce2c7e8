"""Measures what a tick costs each part, and fits the model in docs/scale.md.

A walker on a line is recorded, with its cells in workers. What is measured is processor
time: unlike seconds it adds up, and what else runs on the machine hardly changes it. A
part is taken to spend so much a tick, so much a sensor and so much a pair of sensors.
The three are found at some sizes, and what they say of others is held against runs.
"""

import shutil
import tempfile
from collections import Counter
from itertools import product
from pathlib import Path

import numpy as np
import psutil
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap.protocol.run_options import LearningKind
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
_KINDS: tuple[LearningKind, ...] = ("coordinator", "spread")


def scale(sizes: Sizes) -> list[Line]:
    """Find what a tick costs each part, and what that says of other sizes."""
    lines = []
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        for learning in _KINDS:
            fitted = {size: _spent(size, learning, Path(name)) for size in sizes.fitted}
            model = {
                part: _constants({size: cost[part] for size, cost in fitted.items()})
                for part in _PARTS
            }
            lines += [_of_part(part, model[part], learning) for part in _PARTS]
            for size in sizes.foretold:
                spent = _spent(size, learning, Path(name))
                lines.append(_foretold(size, spent, model, learning))
    return lines


class Spent:
    """What each kind of part has spent, at some of a run's ticks.

    Args:
        begin: The first tick to look at: all parts are up by then.
        every: Ticks from one look to the next, at least.
    """

    def __init__(self, begin: int, every: int = 0) -> None:
        self._begin = begin
        self._every = every
        self._parts = 0
        self._seen: list[tuple[int, Counter[str]]] = []

    def look(self, tick: int) -> None:
        """Look at the parts that this process has started, unless some have ended."""
        if tick < self._begin:
            return
        spent: Counter[str] = Counter()
        found = [*parts_of(psutil.Process())]
        for who, process in found:
            try:
                times = process.cpu_times()
            except psutil.NoSuchProcess:
                return
            spent[who.partition("/")[0]] += times.user + times.system
        self._parts = self._parts or len(found)
        if len(found) == self._parts:
            self._seen.append((tick, spent))
            self._begin = tick + self._every

    def a_tick(self, least: int) -> dict[str, float]:
        """Return the seconds a tick of each kind of part, between first and last look.

        Args:
            least: Ticks that must lie between them.
        """
        (first, before), (last, after) = self._seen[0], self._seen[-1]
        if last - first < least:
            raise RuntimeError(f"ticks {first} to {last}: must be {least} at least")
        return {part: (after[part] - before[part]) / (last - first) for part in after}


def _spent(count: int, learning: LearningKind, folder: Path) -> dict[str, float]:
    """Return the processor seconds a tick of each part, of workers of one of them."""
    at, ticks = folder / f"{count}", max(_TICKS, _READINGS // count)
    at.mkdir()
    options = replace(
        line_options(count, ticks, at),
        cells="worker",
        workers=_WORKERS,
        learning=learning,
        watch=True,
        keyframe_every=1 << 20,
    )
    spent = Spent(_BEGIN)
    run_once(options, at / "run.mcap", Watcher(spent.look))
    shutil.rmtree(at)
    found = spent.a_tick(ticks // 2)
    return found | {"worker": found["worker"] / _WORKERS}


def _terms(count: int) -> NDArray[np.float64]:
    """Return ``(3,)``: once a tick, a thousand sensors, a million pairs."""
    return np.array([1.0, count / 1e3, count * (count - 1) / 2e6])


def _constants(costs: dict[int, float]) -> NDArray[np.float64]:
    """Return ``(3,)``, none below 0: with the least sum of squared relative errors."""
    seconds = np.array([*costs.values()])
    every = np.array([_terms(count) for count in costs]) / seconds[:, None]
    best, least = np.zeros(3), np.inf
    for use in product((False, True), repeat=3):
        found = np.zeros(3)
        found[[*use]] = np.linalg.lstsq(every[:, [*use]], np.ones(len(costs)))[0]
        error = float(((every @ found - 1) ** 2).sum())
        if (found >= 0).all() and error < least:
            best, least = found, error
    return best


def _of_part(part: str, model: NDArray[np.float64], learning: str) -> Line:
    once, sensor, pair = model.tolist()
    return Line(
        f"a tick of the {part}, --learning {learning}",
        f"{once * 1e3:.1f} ms + {sensor * 1e3:.2f} µs a sensor"
        f" + {pair * 1e3:.2f} ns a pair of sensors",
        figures={"once": once, "sensor": sensor * 1e-3, "pair": pair * 1e-6},
    )


def _foretold(
    count: int,
    spent: dict[str, float],
    model: dict[str, NDArray[np.float64]],
    learning: str,
) -> Line:
    """Hold what the model says of a size against what was spent."""
    shown = []
    for part in _PARTS:  # each in milliseconds
        several = 1e3 * (_WORKERS if part == "worker" else 1)
        foretold = several * float(model[part] @ _terms(count))
        shown.append((part, foretold, several * spent[part]))
    said, was = sum(s for _, s, _ in shown), sum(w for *_, w in shown)
    parts = ", ".join(f"{part} {s:.1f} and {w:.1f}" for part, s, w in shown)
    return Line(
        f"a tick of {count:,} sensors, --learning {learning}: foretold and measured",
        f"{said:.1f} and {was:.1f} ms ({said / was - 1:+.0%})",
        f"{parts} ms",
        figures={"foretold": said * 1e-3, "measured": was * 1e-3},
    )
