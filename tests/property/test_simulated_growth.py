"""Swarms that grow sensors in simulation: random schedules, every fault.

Each case is a function of its seed alone; a failure names the seed, and calling the
case with it repeats it message by message.
"""

import functools
import random

import pytest

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.growth.growth import Growth
from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.policies import Walker
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot, Snapshot
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.protocol.world import World
from neurosnap.sources.open import open_source
from tests.support.hypothesis_settings import cases
from tests.support.run_options import core_options
from tests.support.simulated_swarm import Deaf, SimulatedSwarm, repeatable
from tools.simulate.lamp import NAME, Lamp
from tools.simulate.simulated_hub import Faults, SimulatedHub

pytestmark = pytest.mark.slow

SEEDS = range(2, 2 + max(2, cases(4)))
TICKS = 110
KEPT = 64
"""Ticks of the history: fewer than there are, so that its ring is filled anew."""


class GrowingSwarm(SimulatedSwarm):
    """A swarm whose world follows what is decided, and reads what is grown."""

    def __init__(
        self, core: Coordinator, hub: SimulatedHub, body: Body, workers: int, deaf: Deaf
    ) -> None:
        self._lamp = World(open_source(NAME, 3), body)
        super().__init__(core, [[False] * len(body.sensors)], hub, workers, deaf)
        self._world.listen(("state",), self._decided)

    def _decided(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            decision = self._lamp.receive(wire.decode(delivery.key, delivery.payload))
            if decision is not None and (observed := self._lamp.answer(decision)):
                self._world.publish(observed)


def new_body() -> Body:
    return Body.full(Lamp.sensors, Lamp.actions, room=3)


def new_snapshot(seed: int) -> Snapshot:
    names = new_body().sensors
    if seed % 2:
        return DiscountedSnapshot(len(names), 1 / 16, 0.9)
    return EmpiricalSnapshot(len(names), 0.001)


def new_memory() -> AgentMemory:
    memory = AgentMemory(new_body())
    memory.grow_by(Growth(new_body(), KEPT))
    return memory


@functools.cache
def by_one_agent(seed: int) -> list[wire.Decision]:
    """Return what an agent decides that has everything in one process."""
    agent = Agent(new_body(), Walker(3, seed), new_snapshot(seed), new_memory())
    source = open_source(NAME, 3)
    found, seen = list[wire.Decision](), source.first()
    while seen is not None and len(found) < TICKS:
        found.append(agent.act(seen.bits, seen.begins))
        seen = source.step(found[-1].action)
    source.close()
    return found


def simulate(seed: int, workers: int, drop: float = 0.0) -> GrowingSwarm:
    """Run one case, with questions, answers and readings lost on their way to cells."""
    chance = random.Random(seed)
    options = core_options(0, workers, ticks=TICKS, keyframe_every=40, body=new_body())
    core = Coordinator(
        options, new_snapshot(seed), Walker(3, seed), new_memory(), repeats=1000
    )
    lossy = wire.Recall | wire.Recalled | wire.Reminder | wire.Observation

    def deaf(who: str, message: wire.Message) -> bool:
        if isinstance(message, wire.Observation) and who == "coordinator":
            return False
        return isinstance(message, lossy) and chance.random() < drop

    hub = SimulatedHub(seed, Faults(duplicate=0.1))
    swarm = GrowingSwarm(core, hub, new_body(), workers, deaf)
    swarm.run()
    return swarm


def decided(swarm: GrowingSwarm) -> list[wire.Decision]:
    return [m for m in swarm.said if isinstance(m, wire.Decision) and m.tick]


@pytest.mark.parametrize("workers", [0, 3])
def test_a_swarm_grows_what_one_agent_grows_whatever_order_messages_come_in(
    workers: int,
) -> None:
    retired = 0
    for seed in SEEDS:
        with repeatable(seed):
            swarm, alone = simulate(seed, workers), by_one_agent(seed)
            assert decided(swarm) == alone[:-1]
            assert swarm.repeats == 0
            assert any(one.born >= 0 for one in alone)
            retired += sum(one.retires >= 0 for one in alone)
            asked = {m.tick for m in swarm.said if isinstance(m, wire.Recall)}
            # Nobody is asked where there is no surprise.
            assert 0 < len(asked) < TICKS
            # Each cell is reminded once in a life in which it misses nothing.
            reminded = [
                cell
                for m in swarm.said
                if isinstance(m, wire.Reminder)
                for cell in m.cells
            ]
            assert len(reminded) == len(set(reminded))
    assert retired > 0


@pytest.mark.parametrize("workers", [0, 3])
def test_a_swarm_that_loses_questions_and_answers_grows_the_same(workers: int) -> None:
    repeats = 0
    for seed in SEEDS:
        with repeatable(seed):
            swarm = simulate(seed, workers, drop=0.05)
            assert decided(swarm) == by_one_agent(seed)[:-1]
            repeats += sum(
                isinstance(m, wire.Recall) and m.repeats > 0 for m in swarm.said
            )
    assert repeats > len(SEEDS)
