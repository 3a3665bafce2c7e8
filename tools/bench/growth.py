"""Rows on growing sensors: a birth in workers, and decisions while exploring Taxi.

In a swarm a decision's time is from the observation to the decision, by the senders'
clocks, which are one machine's. A birth costs what its tick takes longer than one
without, from its observation to the next state: cells say what the newborn weighs, and
are rewired.
"""

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
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.fit_agent import body_of
from neurosnap.sources.open import open_source
from tools.bench.report import Line, Sizes
from tools.bench.run import run_once
from world.toy_text import taxi

if TYPE_CHECKING:
    from neurosnap.agent.binary_sensors import BinarySensors

_ROOM = 30
_BIRTHS = 15  # by a script
_STATES = 500
_LEARNED = 10  # times as many ticks as of a run, before the clock starts
_BIRTH = 5e-3
_DECISION = {"in process": 20e-3, "in workers": 250e-3}


def growth(sizes: Sizes) -> list[Line]:
    """Time births in workers, and decisions in Taxi."""
    decided = _decided_in_process(sizes)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        births = _Spans(_births(sizes.ticks), Path(folder) / "lake.mcap")
        fares = _Spans(_taxi(sizes.ticks), Path(folder) / "taxi.mcap")
    return [
        _birth(births),
        _decision("in process", decided),
        _decision("in workers", fares.decisions),
    ]


class _Spans:
    """What a recorded run took, in seconds."""

    def __init__(self, options: RunOptions, log: Path) -> None:
        run_once(options, log)
        observed: dict[int, int] = {}
        self.births: list[float] = []
        """From each observation to the next state, where a sensor was grown."""
        self.others: list[float] = []
        """The same where none was."""
        self.decisions: list[float] = []
        """From each observation to the decision."""
        born = -1
        for each in Recording.open(log).messages(("observation", "state", "decision")):
            match each.message:
                case wire.Observation(tick=tick):
                    observed[tick] = each.sent
                case wire.State(tick=tick):
                    if tick - 1 in observed:
                        which = self.births if tick == born + 1 else self.others
                        which.append((each.sent - observed[tick - 1]) / 1e9)
                case wire.Decision(tick=tick) as decision if tick:
                    self.decisions.append((each.sent - observed[tick]) / 1e9)
                    born = tick if decision.born >= 0 else born
                case _:
                    pass


def _births(ticks: int) -> RunOptions:
    """Return a run of a planner on a lake, with sensors grown at even distances."""
    pairs = itertools.product(("row<1", "row<2", "row<3"), ("column<1", "column<2"))
    places = itertools.product(("left", "down", "right"), pairs)
    births = [
        Birth(action, pair, (number + 1) * ticks // (_BIRTHS + 1))
        for number, (action, pair) in enumerate(itertools.islice(places, _BIRTHS))
    ]
    greedy = {"target": ("tile=goal",), "explore": 0.5}
    return _options("neurosnap/FrozenLake-v0", ticks, 0, greedy, births)


def _taxi(ticks: int) -> RunOptions:
    """Return a run of an agent that explores Taxi."""
    planned = {"imagine": _STATES, "explore": "planned"}
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
        cells="worker",
        workers=2,
        **more,
    )


def _birth(lake: _Spans) -> Line:
    usual = statistics.median(lake.others)
    more = statistics.median(lake.births) - usual
    return Line(
        f"a birth, in workers ({len(lake.births)} of them)",
        f"{more * 1e3:.1f} ms more",
        f"a tick without {usual * 1e3:.1f} ms",
        f"≤ {_BIRTH * 1e3:.0f} ms",
        more <= _BIRTH,
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


def _decision(where: str, seconds: list[float]) -> Line:
    mean, most, reach = statistics.fmean(seconds), max(seconds), _DECISION[where]
    return Line(
        f"a decision while exploring Taxi, {where}",
        f"{mean * 1e3:.1f} ms on average, {most * 1e3:.0f} at most",
        "",
        f"≤ {reach * 1e3:.0f} ms",
        mean <= reach,
        {"seconds": mean, "most_seconds": most},
    )
