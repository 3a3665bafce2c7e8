"""Messages a coordinator refuses, and how it repeats a wave that does not settle."""

import pytest

from neurosnap import wire
from tests.support.coordinator_runs import ROWS, Swarm, new, observed, only, partly

# Out of turn --------------------------------------------------------------------------

BEYOND = "observation: packed bits: must be 0 beyond the first 3 bits"


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (wire.Observation(3, b"\0"), "observation: must be tick 1, once, got tick 3"),
        (wire.Observation(1, b"\0\0"), "observation: packed bits: must be 1 bytes"),
        (wire.Observation(1, b"\x08"), f"{BEYOND}, got b'\\x08'"),
        (wire.Observation(1, b"\1", known=b"\x09"), f"{BEYOND}, got b'\\t'"),
        (wire.Observation(1, b"\1", known=b"\x06"), "observation: must be 0 where it"),
        (wire.CellReport(1, 9, 0, (18,), (0,), (2,), 0), "cellreport: must be a cell"),
        (
            wire.CellReport(1, 0, 0, (1,), (0,), (0, 0), 0),
            "cellreport: must be on a wa",
        ),
        (wire.Pulse(1, 0, 2, 1, 0), "pulse: is not for the coordinator"),
        (wire.Decision(0, 0, ""), "decision: is not for the coordinator"),
        (wire.Recalled("cell/1", 1, 1), "recalled: must be asked, got cell/1"),
    ],
)
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    core = new()
    core.begin()
    (fault,) = core.receive(message)
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(what)
    assert core.receive(fault) == []  # as it comes back to it
    assert core.totals.faults == 1
    assert not core.in_flight
    assert core.snapshot.clock == 0
    assert only(wire.WaveStart, core.receive(observed(1, "000")))
    again = "observation: must be tick 1, once, got tick 1"
    assert core.receive(observed(1, "111")) == [wire.Fault("coordinator", again)]
    assert core.in_flight == (1,)


# Late waves ---------------------------------------------------------------------------


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
