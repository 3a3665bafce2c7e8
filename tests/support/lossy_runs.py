"""Runs recorded in the order that a seed draws, with messages lost on their way."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeAlias

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryFabric
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import describe
from neurosnap.sensorium import pack
from tests.support.replayed_runs import readings
from tools.simulate.simulated_hub import SimulatedHub

Lost: TypeAlias = Callable[[int, wire.Message], bool]


def lost_once(which: Lost) -> Lost:
    """Return what is true of the first message only of which `which` is."""
    left = [True]

    def lost(cell: int, message: wire.Message) -> bool:
        if left and which(cell, message):
            left.clear()
            return True
        return False

    return lost


class Simulation:
    """A coordinator, its world and its cells on a hub that needs no loop, recorded.

    Whatever `lost` says of a message on its way to a cell, the recorder hears it; a
    wave that is stuck for it is declared late.
    """

    def __init__(
        self, options: RunOptions, log: Path, seed: int, lost: Lost = lambda *_: False
    ) -> None:
        self.core = Coordinator(options)
        self._hub = SimulatedHub(seed)
        self._rows = readings()
        self._lost = lost
        self._log_time = 0
        self._observed = 0
        self._writer = Writer(log, chunk=2000)
        self._writer.start({**describe(options), "swarm": "simulated"})
        self._ends: dict[str, MemoryFabric] = {}
        self._recorder = self._hub.fabric("recorder")
        self._recorder.listen(("**",), self._record)
        self._conducting = self._join("coordinator")
        self._conducting.listen(("observation", "cellreport/**"), self._conduct)
        self._world = self._join("world")
        self._world.listen(("decision",), self._observe)
        for number in range(len(options.sensors)):
            self._join_cell(number)

    def _join(self, who: str) -> MemoryFabric:
        self._ends[who] = self._hub.fabric(who)
        return self._ends[who]

    def _join_cell(self, number: int) -> None:
        core, end = Cell(number), self._join(f"cell/{number}")

        def handle(deliveries: list[wire.Delivery]) -> None:
            burst = [wire.decode(d.key, d.payload) for d in deliveries]
            kept = [message for message in burst if not self._lost(number, message)]
            for message in core.receive(kept):
                end.publish(message)

        end.listen(wire.cell_keys(number), handle)

    def _record(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self._log_time += 1
            self._writer.add(delivery, self._log_time)

    def _conduct(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self.say(self.core.receive(wire.decode(delivery.key, delivery.payload)))

    def _observe(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            message = wire.decode(delivery.key, delivery.payload)
            assert isinstance(message, wire.Decision)
            bits = self._rows[message.tick]
            self._observed = message.tick + 1
            self._world.publish(wire.Observation(self._observed, pack(bits)))

    def say(self, messages: Iterable[wire.Message]) -> None:
        for message in messages:
            self._conducting.publish(message)

    def run(self, stop: Callable[["Simulation"], bool] = lambda _: False) -> None:
        """Go on until the run is over, asked to stop as soon as `stop` is true."""
        self.say(self.core.begin())
        asked = False
        while self._hub.pending or not self.core.finished:
            if not self._hub.step():
                stuck = self.core.in_flight
                assert stuck, "nothing is under way, and nothing is late"
                self.say(self.core.overdue(stuck[0]))
            if not asked and stop(self):
                asked = True
                self.say(self.core.stop())
        for who, end in self._ends.items():
            end.publish(wire.Leave(who))
        self._hub.run()
        self._writer.finish({}, {who: end.sent for who, end in self._ends.items()})


LOST: dict[str, Lost] = {
    "pulse": lambda _, m: isinstance(m, wire.Pulse) and m.wave > 20,
    "start": lambda _, m: isinstance(m, wire.WaveStart) and m.wave > 20,
    "observation": lambda _, m: isinstance(m, wire.Observation) and m.tick > 9,
    "wiring": lambda _, m: isinstance(m, wire.Wiring) and m.after > 1,
}
