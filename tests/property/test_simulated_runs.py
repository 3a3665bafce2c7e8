"""Whole runs in simulation: random readings, random schedules, every fault.

Each case is a function of its seed alone; a failure names the seed, and calling the
case with it repeats it message by message.
"""

import functools
import random
from typing import NamedTuple

import pytest

from neurosnap import wire
from neurosnap.agent.policies import Walker
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot, Snapshot
from neurosnap.poc.order.graph import WiringKind
from neurosnap.protocol.coordinator import Coordinator
from tests.support.hypothesis_settings import cases
from tests.support.run_options import core_options
from tests.support.simulated_swarm import SimulatedSwarm, repeatable
from tools.simulate.simulated_hub import Faults, SimulatedHub

pytestmark = pytest.mark.slow


RUNS = cases(100)


class Course(NamedTuple):
    """What a run of a coordinator came to, apart from numbers of waves and hops."""

    states: list[list[bool]]
    incoherent: list[bool]
    reached: list[tuple[tuple[int, ...], bytes]]
    decisions: list[tuple[int, int]]


def course_of(swarm: SimulatedSwarm) -> Course:
    states = [m for m in swarm.said if isinstance(m, wire.State)]
    reached = [m for m in swarm.said if isinstance(m, wire.Reached)]
    decisions = [m for m in swarm.said if isinstance(m, wire.Decision)]
    return Course(
        swarm.states(),
        [state.incoherent for state in states],
        [(one.signal, one.literals) for one in reached],
        [(decision.tick, decision.action) for decision in decisions],
    )


def random_rows(chance: random.Random) -> list[list[bool]]:
    """Draw readings that repeat themselves, so that much is learned and then broken."""
    sensors = chance.randint(2, 6)
    pool = [[chance.random() < 0.5 for _ in range(sensors)] for _ in range(4)]
    rows = [list(chance.choice(pool)) for _ in range(chance.randint(10, 30))]
    for row in rows[len(rows) // 2 :]:
        if chance.random() < 0.3:
            row[chance.randrange(sensors)] ^= True
    return rows


def new_snapshot(chance: random.Random, sensors: int) -> Snapshot:
    if chance.random() < 0.5:
        return EmpiricalSnapshot(sensors, threshold=chance.choice([0.01, 0.1, 0.25]))
    return DiscountedSnapshot(sensors, threshold=1 / 16, decay=0.75)


def simulate(
    seed: int, rows: list[list[bool]], wiring: WiringKind, schedule: int, workers: int
) -> tuple[SimulatedSwarm, Course]:
    """Run one case undisturbed, apart from order and duplicates."""
    core = Coordinator(
        core_options(len(rows[0]), workers, wiring=wiring, ticks=len(rows)),
        new_snapshot(random.Random(seed), len(rows[0])),
        Walker(3, seed),
    )
    hub = SimulatedHub(schedule, Faults(duplicate=0.1))
    swarm = SimulatedSwarm(core, rows, hub, workers)
    swarm.run()
    return swarm, course_of(swarm)


@functools.cache
def undisturbed(seed: int) -> tuple[SimulatedSwarm, Course]:
    """Run the case of a seed in cells of their own, with Hasse wiring."""
    return simulate(seed, random_rows(random.Random(seed)), "hasse", seed, workers=0)


def expected_states(seed: int, rows: list[list[bool]]) -> list[list[bool]]:
    snapshot = new_snapshot(random.Random(seed), len(rows[0]))
    return [snapshot.observe(row).tolist() for row in rows]


def test_a_run_is_what_the_snapshot_says_whatever_order_messages_come_in() -> None:
    rewired = incoherent = 0
    for seed in range(RUNS):
        with repeatable(seed):
            rows = random_rows(random.Random(seed))
            first, run = undisturbed(seed)
            assert run.states == expected_states(seed, rows)
            assert [tick for tick, _ in run.decisions] == list(range(len(rows)))
            _, again = simulate(seed, rows, "derived", seed + 1, workers=0)
            assert again == run
            workers = 1 + seed % len(rows[0])
            _, shared = simulate(seed, rows, "hasse", seed, workers)
            assert shared == run
            assert first.repeats == 0
            rewired += bool(first.rewired)
            incoherent += any(run.incoherent)
    assert rewired > RUNS / 2
    assert incoherent > RUNS / 8


def recovered(
    seed: int, rows: list[list[bool]], workers: int
) -> tuple[SimulatedSwarm, Course]:
    """Run one case with messages lost on every way that a late wave mends."""
    chance = random.Random(seed)
    drop = chance.choice([0.01, 0.05])
    snapshot = new_snapshot(random.Random(seed), len(rows[0]))
    wiring = chance.choice(["hasse", "derived"])
    core = Coordinator(
        core_options(len(rows[0]), workers, wiring=wiring, ticks=len(rows)),
        snapshot,
        Walker(3, seed),
        repeats=1000,
    )
    hub = SimulatedHub(seed, Faults(duplicate=0.1))
    cut: set[str] = set()

    def deaf(who: str, message: wire.Message) -> bool:
        """Tell whether `who` loses `message`.

        The coordinator gets its observations, since only waves have deadlines. A change
        of wiring is lost as a link loses it: with all that follows until it is back.
        """
        from_coordinator = message.sender == "coordinator"
        if from_coordinator and who in cut:
            return True
        if isinstance(message, wire.Observation) and who == "coordinator":
            return False
        if chance.random() >= drop:
            return False
        if isinstance(message, wire.Wiring | wire.WorkerWiring):
            cut.add(who)
        return True

    swarm = SimulatedSwarm(core, rows, hub, workers, deaf)
    swarm.run(on_silence=cut.clear)
    return swarm, course_of(swarm)


@pytest.mark.parametrize("shared", [False, True])
def test_a_run_that_loses_messages_comes_to_the_same(shared: bool) -> None:
    repeats = 0
    for seed in range(RUNS):
        with repeatable(seed):
            rows = random_rows(random.Random(seed))
            workers = 2 + seed % (len(rows[0]) - 1) if shared else 0
            _, run = undisturbed(seed)
            swarm, again = recovered(seed, rows, workers)
            assert again.states == run.states
            assert again.incoherent == run.incoherent
            assert again.decisions == run.decisions
            # Planning waves of one tick may settle in any order.
            assert sorted(again.reached) == sorted(run.reached)
            repeats += swarm.repeats
    assert repeats > RUNS
