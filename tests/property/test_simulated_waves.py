"""Waves over random partial orders, with messages reordered or duplicated.

Each case is a function of its seed alone; a failure names the seed, and calling the
case with it (`undisturbed(1234)`) repeats it message by message.
"""

import random
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.poc.order.graph import PocGraph, WiringKind
from neurosnap.protocol.wave_settling import Wave, fired
from neurosnap.protocol.wiring_and_waves import WaveControl
from neurosnap.sensorium import pack
from tests.support import oracles
from tests.support.edges import edge_list, edges_of
from tests.support.hypothesis_settings import cases
from tests.support.memory_hubs import run_out
from tests.support.swarm_parts import Host, hosting, keys_of
from tools.simulate.simulated_hub import Faults, SimulatedHub

# Random orders ------------------------------------------------------------------------


def random_pairs(chance: random.Random, sensors: int) -> oracles.Edges:
    """Draw edges such that no literal is equivalent to its own complement.

    Literals get levels, opposite ones for complements, and edges go up, or along a
    level that is not 0: equivalences, and negligible literals below their complements,
    come up all the time.
    """
    levels = chance.choice([1, 2, 4])
    level = []
    for _ in range(sensors):
        drawn = chance.randint(-levels, levels)
        level += [drawn, -drawn]
    likely = chance.choice([0.0, 0.05, 0.15, 0.4, 1.0])
    return {
        (a, b)
        for a in range(2 * sensors)
        for b in range(2 * sensors)
        if a != b
        and (level[a] < level[b] or level[a] == level[b] != 0)
        and chance.random() < likely
    }


# A conductor and its cells, without a loop --------------------------------------------

FINEST = 256
"""Credit is split less often here: a finer share could not be shifted."""


class Network:
    """Cells on a hub that delivers as its seed says, and a conductor that starts waves.

    It also sees what no part sees, every pulse and all credit, and holds the conductor
    to that: a wave has settled exactly when its credit is whole and no pulse of it is
    under way. The cells are parts of their own, or shared by workers.
    """

    def __init__(self, sensors: int, hub: MemoryHub, workers: int = 0) -> None:
        self.hub = hub
        self.sensors = sensors
        self.conductor = WaveControl(sensors, workers=workers)
        self.hosts = hosting(sensors, workers)
        self.settled: dict[int, Wave] = {}
        self.faults: list[wire.Fault] = []
        self.given: dict[int, int] = {}  # credit in units of 2^-FINEST, by wave
        self.back: dict[int, int] = {}
        self.addressed = 0  # starts that went to one cell
        self.at_once = defaultdict[int, set[int]](set)  # what fired without a hop
        self._under_way: Counter[int] = Counter()  # messages with pulses of each wave
        self._seen: set[tuple[object, ...]] = set()
        for who, host in self.hosts.items():
            self._join(who, host)
        self._coordinator = hub.fabric("coordinator")
        self._coordinator.listen(
            ("cellreport/**", "workerreport/**", "fault/**"), self._hear
        )
        self._world = hub.fabric("world")

    def _join(self, who: str, host: Host) -> None:
        end = self.hub.fabric(who)

        def handle(deliveries: list[wire.Delivery]) -> None:
            burst = [wire.decode(d.key, d.payload) for d in deliveries]
            for message in burst:
                match message:
                    case wire.Pulse():
                        way: tuple[int, ...] = (message.source, message.target)
                    case wire.PulseBatch():
                        way = (message.worker, message.to, message.part)
                    case _:
                        continue
                if self._is_new(message.wave, *way):
                    self._under_way[message.wave] -= 1
            for message in host.receive(burst):
                if isinstance(message, wire.Pulse | wire.PulseBatch):
                    self._under_way[message.wave] += 1
                end.publish(message)

        end.listen(keys_of(host), handle)

    def _is_new(self, *what: object) -> bool:
        new = what not in self._seen
        self._seen.add(what)
        return new

    def _hear(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            message = wire.decode(delivery.key, delivery.payload)
            if isinstance(message, wire.CellReport | wire.WorkerReport):
                self._report(message)
            elif isinstance(message, wire.Fault):
                self.faults.append(message)

    def _report(self, report: wire.CellReport | wire.WorkerReport) -> None:
        number = report.wave
        if self._is_new("report", number, report.sender, report.part):
            self.back[number] += sum(1 << FINEST - e for e in report.credit)
        wave = self.conductor.report(report)
        pulsed = zip(*fired(report), strict=True)
        self.at_once[number] |= {int(a) for a, hops in pulsed if not hops}
        if wave is not None:
            assert self._under_way[number] == 0
            self.settled[number] = wave
        whole = self.back[number] == self.given[number]
        assert whole == (number in self.settled)

    def rewire(self, edges: NDArray[np.bool_]) -> None:
        for message in self.conductor.rewire(edge_list(edges_of(edges))):
            self._coordinator.publish(message)

    def start(self, tick: int, signal: tuple[int, ...]) -> int:
        """Begin a wave, a state wave if `tick` is not 0; return its number."""
        starts = self.conductor.start("state" if tick else "signal", tick, signal)
        number = self.conductor.waves
        seeds = self.sensors if tick else len(signal)
        self.given[number] = seeds << FINEST - max(seeds - 1, 0).bit_length()
        self.back[number] = 0
        for message in starts:
            assert isinstance(message, wire.WaveStart)
            self.addressed += message.cell >= 0
            self._coordinator.publish(message)
        return number

    def observe(self, tick: int, literals: Iterable[int]) -> None:
        bits = [literal % 2 == 0 for literal in sorted(literals)]
        self._world.publish(wire.Observation(tick, pack(bits)))

    def dawdle(self, chance: random.Random) -> None:
        """Let some messages arrive."""
        for _ in range(chance.choice([0, 0, 1, 3, 10, 100])):
            if not self.hub.step():
                return


def launch(
    network: Network, chance: random.Random, ticks: Iterator[int], sensors: int
) -> dict[int, set[int]]:
    """Send several waves, in flight together; return the signal of each."""
    signals: dict[int, set[int]] = {}
    for _ in range(chance.choice([1, 2, 3, 5])):
        network.dawdle(chance)
        if chance.random() < 0.4:
            tick = next(ticks)
            signal = {2 * sensor + chance.randint(0, 1) for sensor in range(sensors)}
            if first := chance.random() < 0.5:
                network.observe(tick, signal)
                network.dawdle(chance)
            number = network.start(tick, ())
            if not first:
                network.dawdle(chance)
                network.observe(tick, signal)
        else:
            size = chance.choice([1, 1, 2, chance.randint(1, 2 * sensors)])
            signal = set(chance.sample(range(2 * sensors), size))
            number = network.start(0, tuple(sorted(signal)))
        signals[number] = signal
    return signals


pytestmark = pytest.mark.slow
UNDISTURBED = cases(3000)  # a seed each


@contextmanager
def repeatable(seed: int) -> Iterator[None]:
    """Say which seed it was if the case fails."""
    try:
        yield
    except BaseException as error:
        error.add_note(f"seed {seed} repeats it")
        raise


def undisturbed(seed: int, *, shared: bool = False) -> int:
    """Send waves over two orders; return how many starts went to single cells."""
    chance = random.Random(seed)
    sensors = chance.randint(1, 7)
    workers = chance.randint(1, sensors) if shared else 0
    duplicate = chance.choice([0.0, 0.1, 0.3])
    hub = SimulatedHub(seed, Faults(duplicate=duplicate))
    network = Network(sensors, hub, workers)
    ticks = iter(range(1, 100))
    for _ in range(2):
        pairs = random_pairs(chance, sensors)
        kind: WiringKind = chance.choice(["hasse", "derived"])
        graph = PocGraph.from_implications(sensors, pairs)
        network.rewire(graph.wiring(kind))
        network.dawdle(chance)
        signals = launch(network, chance, ticks, sensors)
        run_out(network.hub, 100_000)
        edges = pairs | {(b ^ 1, a ^ 1) for a, b in pairs}
        most = graph.height() + 2
        for number, signal in signals.items():
            wave = network.settled[number]
            reached = oracles.reach(edges, signal)
            assert set(np.flatnonzero(wave.reached).tolist()) == reached
            # A pulse may overtake the start that asks for the same literal.
            assert all(a in signal for a in network.at_once[number])
            assert wave.depth <= most
        assert network.conductor.in_flight == ()
    assert network.faults == []
    return network.addressed


def test_waves_reach_all_above_their_signal_and_settle_exactly_then() -> None:
    addressed = 0
    for seed in range(UNDISTURBED):
        with repeatable(seed):
            addressed += undisturbed(seed)
    assert addressed > UNDISTURBED


def test_waves_among_workers_do_the_same_however_cells_are_shared() -> None:
    for seed in range(UNDISTURBED // 6):
        with repeatable(seed):
            assert undisturbed(seed, shared=True) == 0
