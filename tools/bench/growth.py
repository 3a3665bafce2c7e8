"""The row on growing sensors: decisions while exploring Taxi.

In a swarm a decision's time is from the observation to the decision, by the senders'
clocks, which are one machine's.
"""

import statistics
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.environment import Continuing
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
_STATES = 500
_LEARNED = 10  # times as many ticks as of a run, in one process
_REACH = {"in process": 20e-3, "in workers": 250e-3}


def growth(sizes: Sizes) -> list[Line]:
    """Time decisions in Taxi, in one process and in workers."""
    spent = {"in process": _in_process(sizes), "in workers": _in_workers(sizes)}
    return [_line(where, seconds) for where, seconds in spent.items()]


def _in_process(sizes: Sizes) -> list[float]:
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


def _in_workers(sizes: Sizes) -> list[float]:
    world = "neurosnap/Taxi-v0"
    source = open_source(world, 1)
    source.close()
    options = RunOptions(
        source=world,
        body=body_of(source, "planner", _ROOM),
        agent="planner",
        imagine=_STATES,
        explore="planned",
        threshold=1e-5,
        seed=1,
        ticks=sizes.ticks,
        cells="worker",
        workers=2,
    )
    observed: dict[int, int] = {}
    seconds = []
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        log = Path(folder) / "taxi.mcap"
        run_once(options, log)
        for each in Recording.open(log).messages(("observation", "decision")):
            match each.message:
                case wire.Observation(tick=tick):
                    observed[tick] = each.sent
                case wire.Decision(tick=tick) if tick:
                    seconds.append((each.sent - observed[tick]) / 1e9)
                case _:
                    pass
    return seconds


def _line(where: str, seconds: list[float]) -> Line:
    mean, most, reach = statistics.fmean(seconds), max(seconds), _REACH[where]
    return Line(
        f"a decision while exploring Taxi, {where}",
        f"{mean * 1e3:.1f} ms on average, {most * 1e3:.0f} at most",
        "",
        f"≤ {reach * 1e3:.0f} ms",
        mean <= reach,
        {"seconds": mean, "most_seconds": most},
    )
