"""A coordinator with its cells at hand, which answer at once and in order."""

from collections import deque
from collections.abc import Callable, Iterable

from neurosnap import wire
from neurosnap.fabric.in_memory import matches
from neurosnap.protocol.coordinator import Coordinator
from tests.support.swarm_parts import hosting, keys_of


class AnsweringSwarm:
    """A coordinator, and cells or workers that do what it says.

    Args:
        core: The coordinator.
        sensors: How many there are.
        workers: How many share the cells; 0: every cell is a part of its own.
        lost: Which messages nobody gets.
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
        """Deliver until nobody has more to say; return the coordinator's part."""
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
