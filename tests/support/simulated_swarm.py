"""A whole swarm without a loop, whose messages come in the order that a seed draws.

Tests meddle with its messages. A case is a function of its seed alone: calling it again
with the seed of a failure repeats it message by message.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeAlias

from neurosnap import wire
from neurosnap.agent.policies import Walker
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.sent_wiring import SentWiring
from neurosnap.sensorium import unpack
from tests.support.run_options import core_options
from tests.support.swarm_parts import Host, Row, hosting, keys_of, observation
from tools.simulate.simulated_hub import Faults, SimulatedHub

THRESHOLD = 0.2
Rows: TypeAlias = Sequence[Row]
Deaf: TypeAlias = Callable[[str, wire.Message], bool]
"""Tells whether a part, by its name, does not get a message."""


@contextmanager
def repeatable(seed: int) -> Iterator[None]:
    """Say which seed it was if the case fails."""
    try:
        yield
    except BaseException as error:
        error.add_note(f"seed {seed} repeats it")
        raise


class SimulatedSwarm:
    """A coordinator, its cells and a scripted world on one hub, and no loop.

    Args:
        core: The coordinator.
        rows: What the world shows.
        hub: Delivers as its seed says.
        workers: How many share the cells; if 0, every cell is a part.
        deaf: Which messages do not arrive at whom.
    """

    def __init__(
        self,
        core: Coordinator,
        rows: Rows,
        hub: SimulatedHub,
        workers: int = 0,
        deaf: Deaf = lambda _who, _message: False,
    ) -> None:
        self.core = core
        self.rows = rows
        self.said: list[wire.Message] = []
        self.rewired: set[int] = set()
        self.repeats = 0
        self._hub = hub
        self._deaf = deaf
        self._world = hub.fabric("world")
        self._world.listen(("decision",), self._decided)
        self._end = hub.fabric("coordinator")
        self._end.listen(wire.COORDINATOR_KEYS, self._hear)
        for who, host in hosting(len(rows[0]), workers).items():
            self._join(who, host)

    def run(self, on_silence: Callable[[], None] = lambda: None) -> None:
        """Run to the end; whenever all is silent before that, wave by wave is late."""
        self._say(self.core.begin())
        self._hub.run(1_000_000)
        while not self.core.finished:
            assert self.core.in_flight, "silent for ever"
            on_silence()
            for number in self.core.in_flight:
                self.repeats += 1
                self._say(self.core.overdue(number))
            self._hub.run(1_000_000)

    def states(self) -> list[list[bool]]:
        """Return the state of each tick, literal by literal."""
        literals = 2 * len(self.rows[0])
        return [
            unpack(message.literals, literals).tolist()
            for message in self.said
            if isinstance(message, wire.State)
        ]

    def _join(self, who: str, host: Host) -> None:
        end = self._hub.fabric(who)

        def handle(deliveries: list[wire.Delivery]) -> None:
            end.publish(*host.receive(self._heard(who, deliveries)))

        end.listen(keys_of(host), handle)

    def _decided(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            decision = wire.decode(delivery.key, delivery.payload)
            assert isinstance(decision, wire.Decision)
            row = self.rows[decision.tick]
            self._world.publish(observation(decision.tick + 1, row))

    def _hear(self, deliveries: list[wire.Delivery]) -> None:
        for message in self._heard("coordinator", deliveries):
            self._say(self.core.receive(message))

    def _heard(self, who: str, deliveries: list[wire.Delivery]) -> list[wire.Message]:
        messages = [wire.decode(d.key, d.payload) for d in deliveries]
        return [message for message in messages if not self._deaf(who, message)]

    def _say(self, messages: Sequence[wire.Message]) -> None:
        for message in messages:
            if isinstance(message, wire.Wiring | wire.WorkerWiring) and message.after:
                self.rewired.add(self.core.tick)
        self.said += messages
        self._end.publish(*messages)


def counting_swarm(
    rows: Rows,
    seed: int,
    workers: int = 0,
    frame: int = 1 << 16,
    deaf: Deaf = lambda _who, _message: False,
) -> SimulatedSwarm:
    """Return a swarm of an empirical snapshot and a walker.

    Args:
        rows: What the world shows.
        seed: Draws the order of deliveries.
        workers: How many share the cells; if 0, every cell is a part.
        frame: The most edges in a worker's frame.
        deaf: Which messages do not arrive at whom.
    """
    sensors = len(rows[0])
    core = Coordinator(
        core_options(sensors, workers, ticks=len(rows)),
        EmpiricalSnapshot(sensors, threshold=THRESHOLD),
        Walker(2, seed),
    )
    if workers:
        core._control.wiring = SentWiring(sensors, workers, frame)
    return SimulatedSwarm(
        core, rows, SimulatedHub(seed, Faults(duplicate=0.1)), workers, deaf
    )
