"""A coordinator of three sensors, its cells, and what they observe."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.policies import Walker
from neurosnap.agent.policy import Closures, Deliberation, Policy
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.sensorium import pack
from tests.support.run_options import core_options
from tests.support.swarm_parts import AnsweringSwarm

SENSORS = 3
M = TypeVar("M")
Bits = NDArray[np.bool_]


def bits(text: str) -> Bits:
    """Return the readings in a row of 0 and 1."""
    return np.array([digit == "1" for digit in text])


def observed(tick: int, text: str) -> wire.Observation:
    return wire.Observation(tick, pack(bits(text)))


# Sensor 0 implies sensor 1, until the last row contradicts it.
ROWS = ["000", "110", "010", "111", "011", "000", "110", "100"]


class Asks:
    """Asks fixed questions and keeps the answers."""

    def __init__(self, *questions: tuple[int, ...]) -> None:
        self.questions = questions
        self.answers: list[list[Bits]] = []

    def decide(self, tick: int, state: Bits) -> Deliberation:
        answers: Closures = []
        if self.questions:
            answers = yield list(self.questions)
        self.answers.append([answer.copy() for answer in answers])
        return tick, "as asked"

    def grow(self, body: Body) -> None:
        raise AssertionError("no sensor grows here")


def new(
    policy: Policy | None = None, ticks: int = len(ROWS), **options: int
) -> Coordinator:
    repeats = options.pop("repeats", 2)
    return Coordinator(
        core_options(SENSORS, ticks=ticks, **options),
        EmpiricalSnapshot(SENSORS, threshold=0.2),
        policy or Walker(2, 7),
        repeats=repeats,
    )


def learned(rows: Sequence[str]) -> PocGraph:
    """Return the graph that `rows` teach."""
    snapshot = EmpiricalSnapshot(SENSORS, threshold=0.2)
    for row in rows:
        snapshot.observe(bits(row))
    return snapshot.poc_graph()


def above(rows: Sequence[str], *questions: tuple[int, ...]) -> list[list[bool]]:
    """Return what each question's literals imply once `rows` were seen."""
    graph = learned(rows)
    return [graph.up(question).tolist() for question in questions]


class Swarm(AnsweringSwarm):
    """A coordinator and three cells; readings are a text."""

    def __init__(
        self, core: Coordinator, lost: Callable[[wire.Message], bool] = lambda _: False
    ) -> None:
        super().__init__(core, SENSORS, lost=lost)

    def observe(self, tick: int, text: str) -> list[wire.Message]:
        return self.say([observed(tick, text)])

    def run(self, rows: Sequence[str]) -> list[wire.Message]:
        said = self.say(self.core.begin())
        for tick, row in enumerate(rows, 1):
            said += self.observe(tick, row)
        return said


def only(kind: type[M], messages: Sequence[wire.Message]) -> list[M]:
    return [message for message in messages if isinstance(message, kind)]


def partly(tick: int, row: str) -> wire.Observation:
    """An observation, `?` standing for what is unknown."""
    known = pack([digit != "?" for digit in row])
    return wire.Observation(tick, pack(bits(row)), known=known)
