"""What a cell keeps until its wave is announced, and when it forgets it."""

from neurosnap import wire
from tests.support.cell_messages import OWN, ask, given_out, pulse, reports, sent, wired
from tests.support.wave_messages import share, start

# Holding ------------------------------------------------------------------------------


def test_it_holds_pulses_until_the_wave_starts() -> None:
    cell = wired(4)
    early = [pulse(0, credit=2), pulse(6, credit=2)]
    assert cell.receive(early) == []
    out = cell.receive([start()])
    assert [p.target for p in sent(out)] == [4]
    assert given_out(out) == 2 * share(2)


def test_the_start_of_an_earlier_wave_opens_nothing() -> None:
    cell = wired(4)
    cell.receive([pulse(0, wave=2)])
    assert cell.receive([start(1)]) == []


def test_a_held_pulse_fires_along_the_wiring_that_came_before_the_start() -> None:
    cell = wired(4)
    cell.receive([pulse(0)])
    rewired = wire.Wiring(1, 2, 1, add=(8,), drop=(4,))
    out = cell.receive([rewired, start()])
    assert [p.target for p in sent(out)] == [8]


# Waves that only a few are told of ----------------------------------------------------


def test_a_wave_it_was_not_told_of_makes_it_fire_all_the_same() -> None:
    cell = wired(4)
    cell.receive([start(3)])
    assert cell.receive([pulse(0, wave=5, fence=3, credit=1)]) == [
        wire.Pulse(5, OWN, 4, 2, 2, 3),
        wire.CellReport(5, 1, 0, (OWN,), (1,), (2,), 1, epoch=1),
    ]


def test_it_holds_such_a_wave_until_its_fence() -> None:
    cell = wired(4)
    cell.receive([start(2)])
    assert cell.receive([pulse(0, wave=5, fence=3), ask(6, 3, OWN)]) == []
    out = cell.receive([start(3)])
    assert [(p.wave, p.target, p.fence) for p in sent(out)] == [(5, 4, 3), (6, 4, 3)]
    assert given_out(out) == share(3) + share(0)


def test_a_fence_that_comes_late_counts_where_a_later_one_has_come() -> None:
    cell = wired(4)
    cell.receive([start(9), start(3)])
    assert sent(cell.receive([pulse(0, wave=10, fence=9)])) != []


def test_only_what_is_announced_to_all_is_a_fence() -> None:
    cell = wired(4)
    cell.receive([start(1), ask(5, 1, 0)])
    assert cell.receive([pulse(0, wave=6, fence=5)]) == []


def test_a_pulse_may_overtake_the_start_and_no_credit_is_lost() -> None:
    cell = wired(4)
    cell.receive([start(1)])
    (report,) = reports(cell.receive([pulse(0, wave=2, fence=1)]))
    assert (report.literals, report.hops) == ((OWN,), (1,))
    assert cell.receive([ask(2, 1, OWN, credit=1)]) == [
        wire.CellReport(2, 1, 1, (), (), (1,), 0, epoch=1)
    ]


# Forgetting ---------------------------------------------------------------------------


def test_it_forgets_waves_that_have_settled() -> None:
    cell = wired(4)
    cell.receive([start(1), start(2), pulse(0), pulse(0, wave=2)])
    cell.receive([start(3, below=2)])
    assert cell.receive([pulse(6, wave=1), start(1, OWN)]) == []
    assert cell.receive([pulse(6, wave=2)]) == [
        wire.CellReport(2, 1, 1, (), (), (3,), 0, epoch=1)
    ]
    assert set(cell._waves) == {2, 3}


def test_a_start_that_was_overtaken_opens_nothing() -> None:
    cell = wired(4)
    assert cell.receive([start(2, below=2), start(1, OWN)]) == []
    assert set(cell._waves) == {2}


def test_what_is_settled_stays_settled() -> None:
    cell = wired(4)
    cell.receive([start(5, below=5)])
    cell.receive([start(6, below=3)])
    assert cell.receive([pulse(0, wave=4), start(4, OWN, below=3)]) == []
