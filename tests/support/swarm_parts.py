"""The parts of a swarm without a network, which answer at once and in order."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

from neurosnap import wire
from neurosnap.fabric.in_memory import matches
from neurosnap.protocol import partition
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.worker import Worker
from neurosnap.sensorium import pack

Host: TypeAlias = Cell | Worker
Row: TypeAlias = Sequence[bool | None]
"""What every sensor reads at a tick, None if it is unknown."""


def hosting(sensors: int, workers: int) -> dict[str, Host]:
    """Return the parts that cells are, or are hosted by, by name."""
    if not workers:
        return {f"cell/{number}": Cell(number) for number in range(sensors)}
    hosted = partition.shares(sensors, workers)
    return {f"worker/{number}": Worker(number, hosted) for number in range(workers)}


def keys_of(host: Host) -> tuple[str, ...]:
    """Return the keys that a host listens to."""
    if isinstance(host, Cell):
        return wire.cell_keys(host.cell)
    return wire.worker_keys(host.worker)


def observation(tick: int, row: Row) -> wire.Observation:
    """Return a row of readings as the world would tell it."""
    bits, known = pack([on is True for on in row]), pack([on is not None for on in row])
    return wire.Observation(tick, bits, known=known if None in row else b"")


class AnsweringSwarm:
    """A coordinator, and cells or workers that do what it says.

    Args:
        core: The coordinator.
        sensors: How many there are.
        workers: How many share the cells; 0: every cell is a part of its own.
        lost: Which messages are not delivered.
    """

    def __init__(
        self,
        core: Coordinator,
        sensors: int,
        workers: int = 0,
        lost: Callable[[wire.Message], bool] = lambda _: False,
    ) -> None:
        self.core = core
        self.hosts = list(hosting(sensors, workers).values())
        self.lost = lost
        self.heard: list[wire.Message] = []  # what the coordinator was given

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
            match message:
                case wire.Observation() | wire.CellReport() | wire.WorkerReport():
                    self.heard.append(message)
                    queue += self.core.receive(message)
                case _:
                    pass
        return said
