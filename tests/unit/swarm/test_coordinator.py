"""The coordinator's core, with cells at hand that answer at once and in order."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.walker import Walker
from neurosnap.errors import WaveLostError
from neurosnap.poc.snapshot import EmpiricalSnapshot
from neurosnap.sensorium import complete, pack, unpack
from neurosnap.swarm.cell import Cell
from neurosnap.swarm.coordinator import Coordinator, Policy

SENSORS = 3
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

    def ask(self, tick: int, state: Bits) -> list[tuple[int, ...]]:
        return list(self.questions)

    def decide(
        self, tick: int, state: Bits, answers: Sequence[Bits]
    ) -> tuple[int, str]:
        self.answers.append([answer.copy() for answer in answers])
        return tick, "as asked"


def new(
    policy: Policy | None = None, ticks: int = len(ROWS), **options: int
) -> Coordinator:
    return Coordinator(
        EmpiricalSnapshot(SENSORS, threshold=0.2),
        policy or Walker(2, 7),
        ticks=ticks,
        keyframe_every=options.get("keyframe_every", 1000),
        repeats=options.get("repeats", 2),
    )


Mischief = Callable[[wire.Message], bool]


class Swarm:
    """A coordinator and its cells; everybody answers at once."""

    def __init__(
        self, coordinator: Coordinator, lost: Mischief = lambda _: False
    ) -> None:
        self.coordinator = coordinator
        self.cells = [Cell(number) for number in range(SENSORS)]
        self.lost = lost
        self.heard: list[wire.Message] = []  # what the coordinator was given

    def say(self, messages: Sequence[wire.Message]) -> list[wire.Message]:
        """Deliver until nobody has more to say; return the coordinator's part."""
        said: list[wire.Message] = []
        queue = deque(messages)
        while queue:
            message = queue.popleft()
            if message.sender == "coordinator":
                said.append(message)
            if self.lost(message):
                continue
            for cell in self.cells:
                if message.key in wire.cell_keys(cell.cell):
                    queue += cell.receive([message])
            if isinstance(message, wire.Observation | wire.Settled):
                self.heard.append(message)
                queue += self.coordinator.receive(message)
        return said

    def observe(self, tick: int, text: str) -> list[wire.Message]:
        return self.say([observed(tick, text)])

    def run(self, rows: Sequence[str]) -> list[wire.Message]:
        said = self.say(self.coordinator.begin())
        for tick, row in enumerate(rows, 1):
            said += self.observe(tick, row)
        return said


def only[M: wire.Message](kind: type[M], messages: Sequence[wire.Message]) -> list[M]:
    return [message for message in messages if isinstance(message, kind)]
