"""Measures one process: an observation by each kind of snapshot, and a decision."""

import statistics
import time
from itertools import cycle, islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.agent import Agent
from neurosnap.agent.environment import Continuing
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import Snapshot
from tools.bench.report import Line, Sizes
from world.toy_text import taxi

if TYPE_CHECKING:
    from neurosnap.agent.binary_sensors import BinarySensors

_PLACES = 64  # observations there are; each stays above every threshold
_LONGEST = 100  # rounds of all places until the graph must have settled
_REACH = {145: 60e-6, 1000: 2e-3}
_FLIPS = 0.01
_WARM = 1800  # ticks: exceptions are tolerated from 1,568 on
_MOST = 2.0
_LEARNED = 10  # times as many ticks as of a run, to grow sensors in
_DECISION = 20e-3

Bits = NDArray[np.bool_]


def observe(sizes: Sizes) -> list[Line]:
    """Time one observation, once the graph has stopped changing; and noisy ones."""
    return [
        *(
            _observe(kind, sensors, sizes.batches)
            for sensors in sizes.sensors
            for kind in (EmpiricalSnapshot, DiscountedSnapshot)
        ),
        *(_choose(sensors, sizes.batches) for sensors in sizes.sensors),
    ]


def _observe(
    kind: type[EmpiricalSnapshot] | type[DiscountedSnapshot], sensors: int, batches: int
) -> Line:
    snapshot = kind(sensors)
    places = _intervals(sensors)
    _settle(snapshot, places)
    upcoming = cycle(places)
    best = min(
        _timed(snapshot, list(islice(upcoming, _PLACES))) for _ in range(batches)
    )
    reach = _REACH.get(sensors)
    return Line(
        f"{kind.__name__}.observe, {sensors:,} sensors",
        _short(best),
        "",
        "" if reach is None else f"≤ {_short(reach)}",
        None if reach is None else best <= reach,
        {"seconds": best},
    )


def _choose(sensors: int, batches: int) -> Line:
    """Time thresholds that choose themselves against a fixed one, among exceptions."""
    rng = np.random.default_rng(8)
    places = np.array(_intervals(sensors))

    def noisy(ticks: int) -> list[Bits]:
        flips = rng.random((ticks, sensors)) < _FLIPS
        return list(places[rng.integers(0, _PLACES, ticks)] ^ flips)

    fixed, chosen = EmpiricalSnapshot(sensors), EmpiricalSnapshot(sensors, "auto")
    for bits in noisy(_WARM):
        fixed.learn(bits)
        chosen.learn(bits)
    usual, auto = [], []
    for _ in range(batches):
        batch = noisy(_PLACES)
        usual.append(_timed(fixed, batch))
        auto.append(_timed(chosen, batch))
    ratio = min(auto) / min(usual)
    return Line(
        f"EmpiricalSnapshot.observe, threshold auto, {sensors:,} sensors",
        f"{_short(min(auto))} ({ratio:.2f} of a fixed threshold's)",
        f"fixed {_short(min(usual))}",
        f"≤ {_MOST:g} times",
        ratio <= _MOST,
        {"seconds": min(auto), "fixed_seconds": min(usual), "times_fixed": ratio},
    )


def growth(sizes: Sizes) -> list[Line]:
    """Time decisions of an agent that explores Taxi and grows sensors."""
    env: BinarySensors = taxi()
    agent = Agent.of(env, "planner", seed=1, grow=True, explore="planned", imagine=True)
    going_on, seconds = Continuing(env), []
    bits, info = going_on.reset(seed=1)
    for _ in range(sizes.ticks * _LEARNED):
        began = time.perf_counter()
        action = agent.act(bits, info["begins"]).action
        seconds.append(time.perf_counter() - began)
        bits, _, _, _, info = going_on.step(action)
    mean, most = statistics.fmean(seconds), max(seconds)
    return [
        Line(
            "a decision while exploring Taxi, in one process",
            f"{mean * 1e3:.1f} ms on average, {most * 1e3:.0f} at most",
            "",
            f"≤ {_short(_DECISION)}",
            mean <= _DECISION,
            {"seconds": mean, "most_seconds": most},
        )
    ]


def _intervals(sensors: int) -> list[Bits]:
    """Return what sensors that are on along stretches of a line see at each place."""
    rng = np.random.default_rng(7)
    start = rng.integers(0, _PLACES, sensors)
    stop = start + rng.integers(1, _PLACES // 2, sensors)
    places = rng.permutation(_PLACES)
    return [(start <= place) & (place < stop) for place in places]


def _settle(snapshot: Snapshot, places: list[Bits]) -> None:
    """Observe all places over and over until the graph no longer changes."""
    for _ in range(_LONGEST):
        changes = [snapshot.learn(bits) for bits in places]  # a whole round
        if not any(changes):
            return
    raise RuntimeError("observe: the graph must settle, it goes on changing")


def _timed(snapshot: Snapshot, batch: list[Bits]) -> float:
    """Return the seconds that an observation takes."""
    began = time.perf_counter()
    for bits in batch:
        snapshot.observe(bits)
    return (time.perf_counter() - began) / len(batch)


def _short(seconds: float) -> str:
    """Return a short time in words."""
    return f"{seconds * 1e6:.0f} µs" if seconds < 1e-3 else f"{seconds * 1e3:.1f} ms"
