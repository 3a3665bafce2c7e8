"""A cell refuses invalid and oversized messages."""

import pytest

from neurosnap import wire
from neurosnap.protocol.cell import LIGHT, Cell
from neurosnap.protocol.cell_and_worker_base import DEEPEST
from tests.support.wave_messages import LARGEST

OWN = 2  # the literal of sensor 1


def start(wave: int, *, cell: int = -1, **more: int) -> wire.WaveStart:
    fields = {"tick": 0, "credit": 0, "settled_below": 1, "fence": wave, **more}
    return wire.WaveStart(wave, kind="signal", signal=(OWN,), cell=cell, **fields)


def pulse(wave: int, source: int = 0, **more: int) -> wire.Pulse:
    fields = {"hops": 1, "credit": 1, "fence": wave, **more}
    return wire.Pulse(wave, source, OWN, **fields)


def under_way() -> Cell:
    """Return a cell that has come to wave 7 and tick 5, and knows an edge."""
    cell = Cell(1)
    cell.receive([wire.Wiring(1, 1, 0, add=(5,)), wire.Observation(5, b"\2")])
    (sent, report) = cell.receive([wire.WaveStart(7, 5, "state", 0, 7, fence=7)])
    assert isinstance(sent, wire.Pulse)
    assert isinstance(report, wire.CellReport)
    return cell


FAR = 7 + 4096 + 1

WRONG: list[wire.Message] = [
    start(LARGEST),
    start(FAR),
    start(8, fence=FAR),
    start(8, settled_below=9),
    start(8, settled_below=LARGEST),
    start(8, tick=14),
    start(8, credit=DEEPEST + 1),
    start(8, cell=2),
    start(FAR, cell=1),
    pulse(FAR),
    pulse(8, fence=FAR),
    pulse(8, hops=DEEPEST + 1),
    pulse(8, credit=LARGEST),
    wire.Observation(14, b"\2"),
    wire.Observation(6, bytes(2)),
    wire.Wiring(1, FAR, 0),
    wire.Wiring(1, 2, 1, add=tuple(range(DEEPEST + 1))),
    wire.Wiring(1, 2, 1, add_complement=tuple(range(DEEPEST + 1))),
]

FOREIGN: list[tuple[wire.Message, str]] = [
    (wire.Pulse(8, 0, 4, 1, 0), "pulse: must be for this cell, got 4"),
    (wire.Wiring(2, 5, 0, add=(4,)), "wiring: must be for this cell, got 2"),
    (wire.Observation(6, b""), "observation: must hold sensor 1, got 0 bytes"),
    (wire.Observation(6, b"\x02", known=b"\x05"), "observation: must be 0 where it is"),
    (wire.Decision(6, 0, "?"), "decision: is not for a cell"),
    (wire.CellReport(8, 0, 0, (), (), (), 0), "cellreport: is not for a cell"),
]


@pytest.mark.parametrize(
    ("wrong", "what"),
    [*((message, "") for message in WRONG), *FOREIGN],
    ids=lambda given: f"{given!r:.40}",
)
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    wrong: wire.Message, what: str
) -> None:
    clean, tried = under_way(), under_way()
    (fault,) = tried.receive([wrong])
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(what)
    assert len(fault.what) < 100
    rest: list[wire.Message] = [
        wire.Wiring(1, 2, 1, add=(6,)),
        wire.Observation(6, b"\0"),
        wire.WaveStart(8, 6, "state", 0, 8, fence=8),
        pulse(8, 5),
        pulse(9, 5, fence=8),
    ]
    for message in rest:
        assert tried.receive([message]) == clean.receive([message])


def test_what_cannot_come_about_is_forgotten_at_the_first_announcement(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.cell_and_worker_base.WAVES", 3)
    cell = Cell(1)
    # Before any was announced to all, a wave may have any number.
    assert cell.receive([pulse(1000), pulse(9000), pulse(10_000)]) == []
    cell.receive([start(1)])
    assert set(cell._waves) == {1, 1000}
    (report,) = cell.receive([pulse(2, fence=1)])
    assert isinstance(report, wire.CellReport)


def test_a_cell_is_light_while_little_may_wait_to_be_sent() -> None:
    cell, light = under_way(), list[bool]()
    fault = pulse(8, credit=LARGEST)
    more = tuple(range(10, 10 + LIGHT))
    for batch in (
        [fault] * (LIGHT - 3),  # as many as it may, with its edge and what it sent
        [fault],
        [start(8, settled_below=7)],  # the wave before may be under way
        [start(9, settled_below=9)],
        [wire.Wiring(1, 2, 1, add=more)],
    ):
        cell.receive(batch)
        light.append(cell.is_light)
    assert light == [True, False, False, True, False]
