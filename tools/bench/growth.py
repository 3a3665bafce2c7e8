"""Rows on growth: what it costs where nothing is grown, a birth, a decision by plan.

In a swarm a decision's time is from the observation to the decision, by the senders'
clocks, which are one machine's. A birth costs what its tick takes longer than one
without, from its observation to the next state: cells say what the newborn weighs, and
are rewired.
"""

import asyncio
import itertools
import statistics
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.environment import Continuing
from neurosnap.agent.growth.birth import Birth
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sources.open import open_source
from tools.bench.report import Line, Sizes
from world.toy_text import frozen_lake, taxi

if TYPE_CHECKING:
    from neurosnap.agent.binary_sensors import BinarySensors

_ROOM = 30
_BIRTHS = 15  # by a script
_STATES = 500
_LEARNED = 10  # times as many ticks as of a run, before the clock starts
_SHARE = 1.05
_BIRTH: dict[CellKind, float] = {"worker": 5e-3, "process": 50e-3}
_DECISION = {"in process": 20e-3, "in workers": 250e-3}


def growth(sizes: Sizes) -> list[Line]:
    """Time ticks with and without growth, births, and decisions in Taxi."""
    decided = _decided_in_process(sizes)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        lake = _spans(_lake(sizes.ticks, _ROOM), Path(folder) / "lake.mcap")
        births = [
            _birth(kind, _spans(_births(sizes.ticks, kind), Path(folder) / kind))
            for kind in _BIRTH
        ]
        calm = _spans(_lake(sizes.ticks, 0), Path(folder) / "calm.mcap")
        fares = _spans(_taxi(sizes.ticks), Path(folder) / "taxi.mcap")
    return [
        _alone(sizes),
        _swarm(lake, calm),
        *births,
        _decision("in process", statistics.fmean(decided), max(decided)),
        _decision(
            "in workers",
            statistics.fmean(fares.decisions),
            max(fares.decisions),
        ),
    ]


class _Spans:
    """What a recorded run took, in seconds."""

    def __init__(self, log: Path) -> None:
        observed: dict[int, int] = {}
        self.states: list[float] = []
        """From each observation to its state."""
        self.births: list[float] = []
        """From each observation to the next state, where a sensor was grown."""
        self.others: list[float] = []
        """The same where none was."""
        self.decisions: list[float] = []
        """From each observation to the decision."""
        born = -1
        for each in Recording.open(log).messages(("observe", "state", "decide")):
            match each.message:
                case wire.Observation(tick=tick):
                    observed[tick] = each.sent
                case wire.State(tick=tick):
                    self.states.append((each.sent - observed[tick]) / 1e9)
                    if tick - 1 in observed:
                        which = self.births if tick == born + 1 else self.others
                        which.append((each.sent - observed[tick - 1]) / 1e9)
                case wire.Decision(tick=tick) as decision if tick:
                    self.decisions.append((each.sent - observed[tick]) / 1e9)
                    born = tick if decision.born >= 0 else born
                case _:
                    pass


def _spans(options: RunOptions, log: Path) -> _Spans:
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    return _Spans(log)


def _lake(
    ticks: int, room: int, births: Sequence[Birth] = (), cells: CellKind = "worker"
) -> RunOptions:
    """Return a run of a greedy planner on a lake."""
    greedy = {"target": ("tile=goal",), "explore": 0.5, "cells": cells}
    return _options("neurosnap/FrozenLake-v0", ticks, room, greedy, births)


def _births(ticks: int, cells: CellKind) -> RunOptions:
    """Return one in which sensors are grown at even distances."""
    pairs = itertools.product(("row<1", "row<2", "row<3"), ("column<1", "column<2"))
    places = itertools.product(("left", "down", "right"), pairs)
    births = [
        Birth(action, pair, (number + 1) * ticks // (_BIRTHS + 1))
        for number, (action, pair) in enumerate(itertools.islice(places, _BIRTHS))
    ]
    return _lake(ticks, 0, births, cells)


def _taxi(ticks: int) -> RunOptions:
    """Return a run of an agent that explores Taxi."""
    planned = {"imagine": _STATES, "explore": "planned", "cells": "worker"}
    return _options("neurosnap/Taxi-v0", ticks, _ROOM, planned)


def _options(
    world: str,
    ticks: int,
    room: int,
    more: Mapping[str, Any],
    births: Sequence[Birth] = (),
) -> RunOptions:
    """Return a run in which sensors may be grown."""
    source = open_source(world, 1)
    source.close()
    return RunOptions(
        source=world,
        body=body_of(source, "planner", room, births),
        agent="planner",
        threshold=1e-5,
        seed=1,
        ticks=ticks,
        workers=2,
        **more,
    )


def _alone(sizes: Sizes) -> Line:
    """Compare ticks of an agent in one process, with and without growth, in turns."""
    with_growth, without = (_Walk(room, sizes.ticks * _LEARNED) for room in (_ROOM, 0))
    for _ in range(sizes.batches):
        with_growth.go(sizes.ticks)
        without.go(sizes.ticks)
    ours, theirs = min(with_growth.seconds), min(without.seconds)
    return Line(
        f"a tick of a walker on a lake that may grow {_ROOM} sensors, in process",
        f"{ours * 1e6:.0f} µs ({ours / theirs:.1f} ×)",
        f"one that may not {theirs * 1e6:.0f} µs",
        figures={"seconds": ours, "without_seconds": theirs, "ratio": ours / theirs},
    )


class _Walk:
    """A random walk on a lake."""

    def __init__(self, room: int, before: int) -> None:
        env = frozen_lake()
        self._agent = Agent.of(env, "walker", seed=1, grow=room)
        self._env = Continuing(env)
        self._bits, self._info = self._env.reset(seed=1)
        self.seconds: list[float] = []
        self.go(before)
        self.seconds.clear()

    def go(self, ticks: int) -> None:
        """Walk on, and note what a tick of the agent takes."""
        spent = 0.0
        for _ in range(ticks):
            began = time.perf_counter()
            action = self._agent.act(self._bits, self._info["begins"]).action
            spent += time.perf_counter() - began
            self._bits, _, _, _, self._info = self._env.step(action)
        self.seconds.append(spent / ticks)


def _swarm(lake: _Spans, calm: _Spans) -> Line:
    ours, theirs = statistics.median(lake.states), statistics.median(calm.states)
    ratio = ours / theirs
    return Line(
        f"from an observation to its state, in workers, room for {_ROOM} sensors",
        f"{ours * 1e3:.1f} ms ({ratio:.2f} ×)",
        f"no room {theirs * 1e3:.1f} ms",
        f"≤ {_SHARE:g} ×",
        ratio <= _SHARE,
        {"seconds": ours, "without_seconds": theirs, "ratio": ratio},
    )


def _birth(cells: CellKind, lake: _Spans) -> Line:
    usual, reach = statistics.median(lake.others), _BIRTH[cells]
    what = f"a birth, in {cells} cells"
    more = statistics.median(lake.births) - usual
    return Line(
        f"{what} ({len(lake.births)} of them)",
        f"{more * 1e3:.1f} ms more",
        f"a tick without {usual * 1e3:.1f} ms",
        f"≤ {reach * 1e3:.0f} ms",
        more <= reach,
        {"seconds": more, "usual_seconds": usual, "births": len(lake.births)},
    )


def _decided_in_process(sizes: Sizes) -> list[float]:
    env: BinarySensors = taxi()
    agent = Agent.of(env, "planner", seed=1, grow=True, explore="planned", imagine=True)
    going_on, seconds = Continuing(env), []
    bits, info = going_on.reset(seed=1)
    for _ in range(sizes.ticks * _LEARNED):
        began = time.perf_counter()
        action = agent.act(bits, info["begins"]).action
        seconds.append(time.perf_counter() - began)
        bits, _, _, _, info = going_on.step(action)
    return seconds


def _decision(where: str, mean: float, most: float) -> Line:
    reach = _DECISION[where]
    return Line(
        f"a decision while exploring Taxi, {where}",
        f"{mean * 1e3:.1f} ms on average, {most * 1e3:.0f} at most",
        "",
        f"≤ {reach * 1e3:.0f} ms",
        mean <= reach,
        {"seconds": mean, "most_seconds": most},
    )
