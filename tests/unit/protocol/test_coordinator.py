"""The coordinator's core, with simulated cells that answer at once and in order."""

import numpy as np
import pytest
from msgspec.structs import replace

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.protocol.coordinator import Coordinator
from neurosnap.sensorium import unpack
from tests.support.coordinator_runs import (
    ROWS,
    SENSORS,
    AsksNothing,
    Swarm,
    new,
    observed,
    only,
    partly,
)
from tests.support.run_options import core_options

# A run --------------------------------------------------------------------------------


def test_the_last_tick_ends_the_run_with_a_whole_snapshot() -> None:
    swarm = Swarm(new(AsksNothing(), keyframe_every=3))
    said = swarm.run(ROWS)
    assert [frame.tick for frame in only(wire.KeyFrame, said)] == [3, 6, 8]
    frame = said[-1]
    assert isinstance(frame, wire.KeyFrame)
    assert swarm.core.finished
    restored = EmpiricalSnapshot.from_bytes(frame.snapshot)
    assert restored.clock == len(ROWS)
    assert swarm.observe(len(ROWS) + 1, "000") == []


def test_a_run_can_go_on() -> None:
    swarm = Swarm(new(AsksNothing(), ticks=3))
    swarm.run(ROWS[:3])
    swarm.core.resume(5)
    opening = swarm.say(swarm.core.begin())
    assert opening[-1] == wire.Decision(3, 3, "nothing asked")
    swarm.observe(4, ROWS[3])
    said = swarm.observe(5, ROWS[4])
    assert isinstance(said[-1], wire.KeyFrame)
    assert swarm.core.tick == 5


def test_a_core_made_of_its_key_frame_counts_on() -> None:
    swarm = Swarm(new())
    *_, frame = swarm.run(ROWS)
    assert isinstance(frame, wire.KeyFrame)
    again = Coordinator.from_key_frame(core_options(SENSORS), frame)
    assert again.totals == swarm.core.totals
    for workers, wrong, rule in (
        (0, {"epochs": (1, 2)}, "epochs: must be one for all cells"),
        (2, {"epochs": (1, 2, 3)}, "epochs: must be one for each of 2"),
        (0, {"snapshot": b"none"}, "data: must be a Snapshot written"),
    ):
        given, other = core_options(SENSORS, workers), replace(frame, **wrong)
        with pytest.raises(InvalidValueError, match=f"^{rule}"):
            Coordinator.from_key_frame(given, other)


def test_totals_add_up() -> None:
    swarm = Swarm(new())
    said = swarm.run(ROWS)
    totals = swarm.core.totals
    states, reached = only(wire.State, said), only(wire.Reached, said)
    waves: list[wire.State | wire.Reached] = [*states, *reached]
    assert totals.ticks == len(states) == len(ROWS)
    assert totals.waves == len(only(wire.WaveStart, said)) == len(waves)
    assert totals.pulses == sum(wave.pulses for wave in waves) > 0
    assert totals.depth == max(wave.depth for wave in waves)
    assert totals.height == states[-1].height
    assert totals.edges == states[-1].edges > 0
    assert totals.incoherent == 1
    assert totals.faults == 0


def test_the_state_is_what_the_cells_reported_and_nothing_else() -> None:
    core = new(AsksNothing())
    core.begin()
    core.receive(observed(1, "000"))
    # Nobody has learned that sensor 1 is on, and yet its cell says so.
    reports = [
        wire.CellReport(1, 0, 0, (1,), (0,), (2,), 0, epoch=1),
        wire.CellReport(1, 1, 0, (3, 2), (0, 1), (2,), 0, epoch=1),
        wire.CellReport(1, 2, 0, (5,), (0,), (2,), 0, epoch=1),
    ]
    (state,) = only(wire.State, [m for r in reports for m in core.receive(r)])
    assert np.flatnonzero(unpack(state.literals, 2 * SENSORS)).tolist() == [1, 5]
    assert state.incoherent
    assert state.depth == 1


# Unknown readings ---------------------------------------------------------------------


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


# The end ------------------------------------------------------------------------------


def test_asked_to_stop_between_ticks_it_ends_at_once() -> None:
    swarm = Swarm(new())
    swarm.run(ROWS[:2])
    (frame,) = swarm.core.stop()
    assert isinstance(frame, wire.KeyFrame)
    assert frame.tick == 2
    assert swarm.core.finished
    assert swarm.core.stop() == []
    assert swarm.observe(3, ROWS[2]) == []


def test_asked_to_stop_within_a_tick_it_ends_the_tick_first() -> None:
    swarm = Swarm(new(AsksNothing()))
    swarm.run(ROWS[:2])
    starts = swarm.core.receive(observed(3, ROWS[2]))
    assert swarm.core.stop() == []
    assert not swarm.core.finished
    for host in swarm.hosts:
        host.receive([observed(3, ROWS[2])])
    said = swarm.say(starts)
    assert [m.tick for m in only(wire.State, said)] == [3]
    assert only(wire.Decision, said) == []
    assert [m.tick for m in only(wire.KeyFrame, said)] == [3]
    assert swarm.core.finished


def test_asked_to_stop_before_the_first_tick_it_leaves_nothing() -> None:
    core = new()
    core.begin()
    assert core.stop() == []
    assert core.finished
