"""A whole network without a loop, for tests that meddle with its messages."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from neurosnap import wire
from neurosnap.agent.random_walk import Walker
from neurosnap.fabric.in_memory import Faults, MemoryHub
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.partition import shares
from neurosnap.protocol.sent_worker_wiring import WorkerWires
from neurosnap.protocol.worker import Worker
from neurosnap.sensorium import pack, unpack

THRESHOLD = 0.2
Rows: TypeAlias = Sequence[Sequence[bool | None]]
"""What every sensor reads at each tick; None: that is unknown."""


def observation(tick: int, row: Sequence[bool | None]) -> wire.Observation:
    """Return a row of readings as the world would tell it."""
    bits, known = pack([on is True for on in row]), pack([on is not None for on in row])
    return wire.Observation(tick, bits, known=known if None in row else b"")


class Swarm:
    """A coordinator, its cells and a scripted world on one hub, and no loop.

    Args:
        rows: What the world shows.
        seed: Draws the order of deliveries.
        workers: How many share the cells; 0: every cell is a part of its own.
        frame: The most edges in a worker's frame.
        deaf: Which messages do not arrive at whom, of the cells or workers.
    """

    def __init__(
        self,
        rows: Rows,
        seed: int,
        workers: int = 0,
        frame: int = 1 << 16,
        deaf: Callable[[str, wire.Message], bool] = lambda _who, _message: False,
    ) -> None:
        sensors = len(rows[0])
        self.rows = rows
        self.said: list[wire.Message] = []
        self.repeats = 0
        self.deaf = deaf
        self.core = Coordinator(
            EmpiricalSnapshot(sensors, threshold=THRESHOLD),
            Walker(2, seed),
            ticks=len(rows),
            workers=workers,
        )
        self.hub = MemoryHub(seed, Faults(duplicate=0.1))
        self.world = self.hub.fabric("world")
        self.world.listen(("decide",), self.decided)
        self.end = self.hub.fabric("coordinator")
        self.end.listen(wire.COORDINATOR_KEYS, self.hear)
        if workers:
            wires = WorkerWires(sensors, workers, frame)
            self.core._control._wires = wires
            for number in range(workers):
                worker = Worker(number, shares(sensors, workers))
                self.join(f"worker/{number}", worker, wire.worker_keys(number))
        else:
            for number in range(sensors):
                self.join(f"cell/{number}", Cell(number), wire.cell_keys(number))

    def join(self, who: str, host: Cell | Worker, keys: tuple[str, ...]) -> None:
        end = self.hub.fabric(who)

        def handle(deliveries: list[wire.Delivery]) -> None:
            burst = [wire.decode(d.key, d.payload) for d in deliveries]
            heard = [message for message in burst if not self.deaf(who, message)]
            end.publish(*host.receive(heard))

        end.listen(keys, handle)

    def decided(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            decision = wire.decode(delivery.key, delivery.payload)
            assert isinstance(decision, wire.Decision)
            row = self.rows[decision.tick]
            self.world.publish(observation(decision.tick + 1, row))

    def hear(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self.say(self.core.receive(wire.decode(delivery.key, delivery.payload)))

    def say(self, messages: list[wire.Message]) -> None:
        self.said += messages
        self.end.publish(*messages)

    def run(self) -> None:
        """Run to the end; whenever all is silent before that, every wave is late."""
        self.say(self.core.begin())
        self.hub.run(1_000_000)
        while not self.core.finished:
            assert self.core.in_flight, "silent for ever"
            for number in self.core.in_flight:
                self.repeats += 1
                self.say(self.core.overdue(number))
            self.hub.run(1_000_000)

    def states(self) -> list[list[bool]]:
        """Return the state of each tick, literal by literal."""
        literals = 2 * len(self.rows[0])
        return [
            unpack(message.literals, literals).tolist()
            for message in self.said
            if isinstance(message, wire.State)
        ]
