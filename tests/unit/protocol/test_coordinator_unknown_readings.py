"""What a coordinator learns and believes of readings that are partly unknown."""

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.sensorium import pack, unpack
from tests.support import oracles
from tests.support.coordinator_runs import (
    ROWS,
    SENSORS,
    Swarm,
    bits,
    new,
    observed,
    only,
    partly,
)


def test_what_is_implied_of_an_unknown_reading_is_in_the_state() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:4])  # sensor 0 implies sensor 1
    said = swarm.say([partly(5, "1??")])
    start = only(wire.WaveStart, said)[0]
    assert (start.kind, start.credit) == ("state", 0)
    (state,) = only(wire.State, said)
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [0, 2]
    assert not state.incoherent
    (state,) = only(wire.State, swarm.say([partly(6, "?1?")]))
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [2]


def test_what_is_unknown_is_not_learned_from() -> None:
    swarm, snapshot = Swarm(new()), EmpiricalSnapshot(SENSORS, threshold=0.2)
    swarm.run(ROWS[:4])
    swarm.say([partly(5, "1?0")])
    for row in ROWS[:4]:
        snapshot.learn(bits(row))
    snapshot.learn(bits("1?0"), np.array([True, False, True]))
    assert swarm.core.snapshot.clock == 5
    for a, b in oracles.proper_pairs(2 * SENSORS):
        assert swarm.core.snapshot.weight(a, b) == snapshot.weight(a, b)


def test_a_partial_observation_that_contradicts_what_was_learned_says_so() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:7])
    (state,) = only(wire.State, swarm.say([partly(8, "10?")]))
    assert state.incoherent
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [5]


def test_everything_known_is_the_same_said_or_not() -> None:
    said, plain = Swarm(new()), Swarm(new())
    said.run(ROWS[:4])
    plain.run(ROWS[:4])
    whole = wire.Observation(5, pack(bits(ROWS[4])), known=b"\x07")
    assert said.say([whole]) == plain.observe(5, ROWS[4])


@pytest.mark.parametrize(
    ("known", "what"),
    [
        (b"\x07\x00", "must say which of 1 bytes are known, got 2 bytes"),
        (b"\x06", "must be 0 where it is not known, got sensor 0 on"),
        (b"\x09", "packed bits: must be 0 beyond the first 3 bits, got b'\\t'"),
    ],
)
def test_an_observation_that_contradicts_itself_is_a_fault(
    known: bytes, what: str
) -> None:
    core = new()
    core.begin()
    wrong = wire.Observation(1, b"\x01", known=known)
    assert core.receive(wrong) == [wire.Fault("coordinator", f"observation: {what}")]
    assert core.snapshot.clock == 0
    assert only(wire.WaveStart, core.receive(observed(1, "000")))


def test_a_late_wave_is_repeated_with_what_is_known() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:4])
    swarm.lost = lambda m: isinstance(m, wire.CellReport)
    swarm.say([partly(5, "?10")])
    swarm.lost = lambda _: False
    said = swarm.say(swarm.core.overdue(swarm.core.in_flight[0]))
    start = only(wire.WaveStart, said)[0]
    assert (start.kind, start.signal, start.credit) == ("state", (2, 5), 1)
    assert only(wire.State, said)
