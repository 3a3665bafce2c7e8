"""By which wiring a cell acts, and what becomes of one that missed a change."""

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from tests.support.cell_messages import (
    COMPLEMENT,
    OWN,
    observation,
    pulse,
    reports,
    sent,
    wired,
)
from tests.support.wave_messages import start, state_wave

# By which wiring it acts --------------------------------------------------------------


def test_it_says_by_which_wiring_it_acted_and_what_comes_after_does_not_count() -> None:
    cell = wired(4)
    changed = wire.Wiring(1, 2, 1, add=(8,), drop=(4,))
    out = cell.receive([start(1, OWN), changed, pulse(0), start(2, OWN)])
    assert out == [
        wire.Pulse(1, OWN, 4, 1, 1, 1),
        wire.CellReport(1, 1, 0, (OWN,), (0,), (1,), 1, epoch=1),
        wire.Pulse(2, OWN, 8, 1, 1, 2),
        wire.CellReport(1, 1, 1, (), (), (3,), 0, epoch=2),
        wire.CellReport(2, 1, 0, (OWN,), (0,), (1,), 1, epoch=2),
    ]


def test_a_cell_that_was_never_wired_says_so() -> None:
    (report,) = reports(Cell(1).receive([start(1, OWN)]))
    assert report.epoch == 0


# Wiring -------------------------------------------------------------------------------


def test_changes_build_on_the_wiring_before() -> None:
    cell = wired(4, 6, complement=[8])
    change = wire.Wiring(
        1, 2, 1, add=(9,), drop=(4,), add_complement=(5,), drop_complement=(8,)
    )
    assert cell.receive([change]) == []
    out = cell.receive([start(1, OWN, COMPLEMENT)])
    assert [(p.source, p.target) for p in sent(out)] == [(2, 6), (2, 9), (3, 5)]


def test_a_whole_wiring_forgets_the_one_before() -> None:
    cell = wired(4, 6, complement=[8])
    cell.receive([wire.Wiring(1, 7, 0, add=(9,))])
    out = cell.receive([start(1, OWN, COMPLEMENT)])
    assert [(p.source, p.target) for p in sent(out)] == [(2, 9)]


def test_a_gap_in_the_wirings_is_a_fault_and_silences_it() -> None:
    cell = wired(4)
    assert cell.receive([wire.Wiring(1, 3, 2, add=(6,))]) == [
        wire.Fault("cell/1", "wiring: must build on epoch 1, got 2")
    ]
    assert cell.receive([start(1, OWN), pulse(0), observation(1, on=True)]) == []
    assert cell.receive([state_wave(2, 1)]) == []


def test_a_change_of_a_wiring_that_was_replaced_is_a_fault() -> None:
    cell = wired(4)
    assert cell.receive([wire.Wiring(1, 2, 1, add=(6,))]) == []
    assert cell.receive([wire.Wiring(1, 3, 1, add=(8,))]) == [
        wire.Fault("cell/1", "wiring: must build on epoch 2, got 1")
    ]


def test_a_wiring_that_comes_again_changes_nothing() -> None:
    cell = wired(4)
    change = wire.Wiring(1, 2, 1, add=(6,), drop=(4,))
    for wiring in (change, change, wire.Wiring(1, 1, 0, add=(4,))):
        assert cell.receive([wiring]) == []
    assert [p.target for p in sent(cell.receive([start(1, OWN)]))] == [6]


def test_a_whole_wiring_ends_the_silence() -> None:
    cell = wired(4)
    cell.receive([wire.Wiring(1, 3, 2, add=(6,)), start(1, OWN)])
    assert cell.receive([wire.Wiring(1, 4, 0, add=(4, 6))]) == []
    out = cell.receive([start(2, OWN, below=2)])
    assert [p.target for p in sent(out)] == [4, 6]


def test_changes_alone_do_not_end_the_silence() -> None:
    cell = wired(4)
    cell.receive([wire.Wiring(1, 3, 2, add=(6,))])
    (fault,) = cell.receive([wire.Wiring(1, 4, 3, add=(8,))])
    assert isinstance(fault, wire.Fault)
    assert cell.receive([start(1, OWN)]) == []
