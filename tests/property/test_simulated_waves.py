"""Waves in simulation: random orders, random schedules, every fault.

Each case is a function of its seed alone; a failure names the seed, and calling the
case with it (`undisturbed(1234)`) repeats it message by message.
"""

import random
from collections import Counter
from fractions import Fraction
from typing import TypeVar

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.poc.order.graph import PocGraph, WiringKind
from neurosnap.protocol.wave import Wave
from tests.support.edges import edges_of
from tests.support.hypothesis_settings import cases
from tests.support.simulated_swarm import repeatable
from tests.support.simulated_waves import (
    FINEST,
    Neighbours,
    Network,
    closed,
    height,
    launch,
    neighbours,
    random_pairs,
    reach,
)
from tools.simulate.simulated_hub import Faults, SimulatedHub

pytestmark = pytest.mark.slow

UNDISTURBED = cases(3000)  # a seed each
DISTURBED = cases(600)
ONE_LOST = cases(400)


# Nothing is lost ----------------------------------------------------------------------


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
        network.hub.run(100_000)
        out = neighbours(closed(pairs))
        most = height(sensors, out) + 2
        for number, signal in signals.items():
            wave = network.settled[number]
            assert set(wave.hops) == reach(out, signal)
            assert set(np.flatnonzero(graph.up(signal))) == set(wave.hops)
            # A pulse may overtake the start that asks for the same literal.
            assert all(hops > 0 or a in signal for a, hops in wave.hops.items())
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


# Something is lost --------------------------------------------------------------------


def disturbed(seed: int, *, shared: bool = False) -> Counter[bool]:
    """Lose messages; return how many waves settled and how many did not."""
    chance = random.Random(seed)
    sensors = chance.randint(2, 7)
    workers = chance.randint(2, sensors) if shared else 0
    faults = Faults(
        duplicate=chance.choice([0.0, 0.2]), drop=chance.choice([0.003, 0.02, 0.1])
    )
    network = Network(sensors, SimulatedHub(seed, faults), workers)
    pairs = random_pairs(chance, sensors)
    kind: WiringKind = chance.choice(["hasse", "derived"])
    network.rewire_at_once(PocGraph.from_implications(sensors, pairs).wiring(kind))
    signals = launch(network, chance, iter(range(1, 100)), sensors)
    network.hub.run(100_000)
    out = neighbours(closed(pairs))
    for number, signal in signals.items():
        if number in network.settled:
            assert set(network.settled[number].hops) == reach(out, signal)
        else:
            wave = network.conductor._flying[number]
            left = network.given[number] - network.back[number]
            assert wave.missing == Fraction(left, 1 << FINEST) > 0
            assert set(wave.hops) <= reach(out, signal)
    return Counter(number in network.settled for number in signals)


@pytest.mark.parametrize("shared", [False, True])
def test_waves_that_lost_messages_settle_rightly_or_not_at_all(shared: bool) -> None:
    settled: Counter[bool] = Counter()
    for seed in range(DISTURBED):
        with repeatable(seed):
            settled += disturbed(seed, shared=shared)
    assert min(settled[True], settled[False]) > DISTURBED / 4


Lost = TypeVar("Lost", wire.Pulse, wire.CellReport)


def one_lost(
    seed: int, kind: type[Lost]
) -> tuple[Lost, Wave, list[int], Neighbours, set[int]] | None:
    """Lose one message of `kind`; return it, its wave, who is silent, order, signal."""
    chance = random.Random(seed)
    sensors = chance.randint(2, 7)
    pairs = random_pairs(chance, sensors)
    network = Network(sensors, SimulatedHub(seed, Faults(duplicate=0.1)))
    edges = PocGraph.from_implications(sensors, pairs).hasse()
    network.rewire_at_once(edges)
    which, lost = chance.randrange(2 * sensors), list[Lost]()
    count = iter(range(10_000))

    def withheld(message: wire.Message) -> bool:
        if isinstance(message, kind) and next(count) == which:
            lost.append(message)
            return True
        return False

    network.withheld = withheld
    signal = set(chance.sample(range(2 * sensors), chance.randint(1, 3)))
    number = network.start(0, tuple(sorted(signal)))
    network.hub.run(100_000)
    if not lost:
        return None
    wave = network.conductor._flying[number]
    wired = neighbours(edges_of(edges))
    silent = wave.silent(signal, lambda literal: wired.get(literal, []))
    return lost[0], wave, silent, wired, signal


def test_the_cell_that_a_lost_pulse_was_for_is_named() -> None:
    outcomes: Counter[bool] = Counter()
    for seed in range(ONE_LOST):
        with repeatable(seed):
            found = one_lost(seed, wire.Pulse)
            if found is None:
                continue
            pulse, wave, silent, wired, signal = found
            wired[pulse.source].remove(pulse.target)
            found_otherwise = pulse.target in reach(wired, signal)
            assert wave.missing == Fraction(1, 2**pulse.credit)
            assert silent == ([] if found_otherwise else [pulse.target // 2])
            outcomes[found_otherwise] += 1
    assert min(outcomes[True], outcomes[False]) > ONE_LOST / 10


def test_the_cell_whose_report_was_lost_is_named() -> None:
    outcomes: Counter[bool] = Counter()
    for seed in range(ONE_LOST):
        with repeatable(seed):
            found = one_lost(seed, wire.CellReport)
            if found is None:
                continue
            report, wave, silent, _, _ = found
            assert wave.missing == sum(Fraction(1, 2**e) for e in report.credit)
            assert silent == ([report.cell] if report.literals else [])
            outcomes[bool(report.literals)] += 1
    assert min(outcomes[True], outcomes[False]) > ONE_LOST / 20
