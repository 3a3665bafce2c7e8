"""A coordinator of three sensors, its cells, and what they observe."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.policy import Deliberation, Policy
from neurosnap.agent.policy_kinds import Walker
from neurosnap.fabric.in_memory import matches
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.sensorium import pack
from tests.support.run_options import core_options
from tests.support.swarm_parts import hosting, keys_of

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


class AsksNothing:
    """Asks nothing, and decides by the tick."""

    def decide(self, tick: int, state: Bits) -> Deliberation:
        yield from ()
        return tick, "nothing asked"

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


class Swarm:
    """A coordinator and three cells, which answer at once and in order.

    Attributes:
        lost: Which messages are not delivered.
    """

    def __init__(self, core: Coordinator) -> None:
        self.core = core
        self.hosts = list(hosting(SENSORS, 0).values())
        self.lost: Callable[[wire.Message], bool] = lambda _: False

    def say(self, messages: Iterable[wire.Message]) -> list[wire.Message]:
        """Deliver until no part has more to say; return the coordinator's part."""
        said: list[wire.Message] = []
        queue = deque(messages)
        while queue:
            message = queue.popleft()
            if message.sender == "coordinator":
                said.append(message)
            if self.lost(message):
                continue
            for host in self.hosts:
                if any(matches(key, message.key) for key in keys_of(host)):
                    queue += host.receive([message])
            if isinstance(message, wire.Observation | wire.CellReport):
                queue += self.core.receive(message)
        return said

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
