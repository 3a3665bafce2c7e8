"""Readings that are unknown: what is left out, and what is implied all the same.

Whole networks over the fabric in memory, against the snapshot's graph and loops over
its edges. Each case is a function of its seed alone.
"""

import random

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.sensorium import unpack
from tests.support import oracles
from tests.support.edges import edges_of
from tests.support.simulated_swarm import THRESHOLD, SimulatedSwarm, counting_swarm

pytestmark = pytest.mark.slow

CASES = 60
Row = list[bool | None]


def random_rows(chance: random.Random) -> list[Row]:
    """Draw readings of an order that is learned, with unknown ones among them."""
    sensors = chance.randint(2, 6)
    pool: list[Row] = [[chance.random() < 0.5 for _ in range(sensors)] for _ in "1234"]
    share = chance.choice([0.0, 0.2, 0.5, 0.8])
    rows = []
    for _ in range(chance.randint(10, 20)):
        row = [None if chance.random() < share else on for on in chance.choice(pool)]
        if all(on is None for on in row):
            row[chance.randrange(sensors)] = chance.random() < 0.5
        rows.append(row)
    return rows


def observed(row: Row) -> set[int]:
    """The literals of the sensors whose reading is known."""
    return {2 * sensor + (not on) for sensor, on in enumerate(row) if on is not None}


def expected(rows: list[Row]) -> list[tuple[set[int], bool]]:
    """Each tick's state, and whether the observation was contradicted."""
    snapshot, states = EmpiricalSnapshot(len(rows[0]), threshold=THRESHOLD), []
    for row in rows:
        known = np.array([on is not None for on in row])
        snapshot.learn([on is True for on in row], None if known.all() else known)
        edges = edges_of(snapshot.poc_graph().edges)
        above = oracles.reach(edges, observed(row))
        state = {a for a in above if a ^ 1 not in above}
        assert state == set(
            np.flatnonzero(snapshot.poc_graph().coherent_projection(observed(row)))
        )
        states.append((state, state != above))
    return states


def states_of(swarm: SimulatedSwarm) -> list[tuple[set[int], bool]]:
    literals = 2 * len(swarm.rows[0])
    return [
        (set(np.flatnonzero(unpack(said.literals, literals))), said.incoherent)
        for said in swarm.said
        if isinstance(said, wire.State)
    ]


@pytest.mark.parametrize("shared", [False, True])
def test_the_state_is_what_the_known_readings_imply(shared: bool) -> None:
    predicted = contradicted = 0
    for seed in range(CASES):
        chance = random.Random(seed)
        rows = random_rows(chance)
        workers = chance.randint(1, len(rows[0])) if shared else 0
        swarm = counting_swarm(rows, seed, workers)
        swarm.run()
        states = states_of(swarm)
        assert states == expected(rows), f"seed {seed}"
        assert swarm.repeats == 0
        for row, (state, incoherent) in zip(rows, states, strict=True):
            predicted += any(row[literal // 2] is None for literal in state)
            contradicted += incoherent
    assert predicted > CASES / 4
    assert contradicted > CASES / 8


@pytest.mark.parametrize("shared", [False, True])
def test_who_missed_the_observation_is_told_what_was_observed(shared: bool) -> None:
    repeats = 0
    for seed in range(CASES):
        chance = random.Random(seed)
        rows = random_rows(chance)
        workers = chance.randint(1, len(rows[0])) if shared else 0
        whose = chance.randrange(workers or len(rows[0]))
        tick = chance.randrange(1, len(rows) + 1)
        name = f"worker/{whose}" if workers else f"cell/{whose}"

        def deaf(
            who: str, message: wire.Message, name: str = name, at: int = tick
        ) -> bool:
            return (
                who == name
                and isinstance(message, wire.Observation)
                and message.tick == at
            )

        swarm = counting_swarm(rows, seed, workers, deaf=deaf)
        swarm.run()
        assert states_of(swarm) == expected(rows), f"seed {seed}"
        repeats += swarm.repeats
    assert repeats > CASES / 4
