"""One cell, message by message."""

from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from neurosnap.sensorium import pack
from tests.support.cell_messages import (
    COMPLEMENT,
    OWN,
    given_out,
    observation,
    pulse,
    reports,
    sent,
    wired,
)
from tests.support.wave_messages import share, start, state_wave

# Firing -------------------------------------------------------------------------------


def test_a_pulse_makes_it_pulse_its_targets_and_report() -> None:
    cell = wired(4, 7)
    assert cell.receive([start(), pulse(0, hops=3, credit=1)]) == [
        wire.Pulse(1, OWN, 4, 4, 3, 1),
        wire.Pulse(1, OWN, 7, 4, 3, 1),
        wire.CellReport(1, 1, 0, (OWN,), (3,), (2,), 2, epoch=1),
    ]


def test_a_signal_makes_it_fire_at_no_hops() -> None:
    cell = wired(4)
    assert cell.receive([start(1, 0, OWN, 5, credit=2)]) == [
        wire.Pulse(1, OWN, 4, 1, 3, 1),
        wire.CellReport(1, 1, 0, (OWN,), (0,), (3,), 1, epoch=1),
    ]


def test_a_signal_that_asks_others_leaves_it_silent() -> None:
    assert wired(4).receive([start(1, 0, 5)]) == []


def test_each_literal_fires_along_its_own_edges() -> None:
    cell = wired(4, complement=[6])
    out = cell.receive([start(1, OWN, COMPLEMENT, credit=1)])
    assert {(p.source, p.target) for p in sent(out)} == {(OWN, 4), (COMPLEMENT, 6)}
    (report,) = reports(out)
    assert report.literals == (OWN, COMPLEMENT)


def test_without_edges_all_credit_goes_back() -> None:
    cell = Cell(1)
    assert cell.receive([start(1, OWN, credit=5)]) == [
        wire.CellReport(1, 1, 0, (OWN,), (0,), (5,), 0)
    ]


def test_it_fires_once_a_wave() -> None:
    cell = wired(4)
    first = cell.receive([start(), pulse(0)])
    again = cell.receive([pulse(6, hops=9, credit=7)])
    assert len(sent(first)) == 1
    assert again == [wire.CellReport(1, 1, 1, (), (), (7,), 0, epoch=1)]


def test_it_fires_again_in_another_wave() -> None:
    cell = wired(4)
    cell.receive([start(1), pulse(0)])
    out = cell.receive([start(2), pulse(0, wave=2)])
    assert [p.wave for p in sent(out)] == [2]


def test_the_first_pulse_gives_the_hops() -> None:
    (report,) = reports(
        wired(4).receive([start(), pulse(0, hops=5), pulse(6, hops=2), pulse(8)])
    )
    assert report.hops == (5,)


def test_pulses_go_out_before_the_report() -> None:
    out = wired(4, 6, complement=[8]).receive([start(1, OWN, COMPLEMENT)])
    assert [type(m) for m in out] == [*[wire.Pulse] * 3, wire.CellReport]


def test_reports_of_a_wave_are_numbered() -> None:
    cell = wired(4)
    cell.receive([start()])
    parts = [reports(cell.receive([pulse(s)]))[0].part for s in (0, 6, 8)]
    assert parts == [0, 1, 2]


def test_a_burst_takes_one_report_a_wave() -> None:
    cell = wired(4)
    out = cell.receive([start(1), start(2), pulse(0), pulse(0, wave=2), pulse(6)])
    assert [(r.wave, len(r.credit)) for r in reports(out)] == [(1, 2), (2, 1)]


@given(
    own=st.sets(st.integers(4, 40), max_size=6),
    complement=st.sets(st.integers(4, 40), max_size=6),
    signal=st.sets(st.sampled_from([OWN, COMPLEMENT])),
    signal_credit=st.integers(0, 5),
    pulses=st.lists(
        st.tuples(st.integers(4, 40), st.sampled_from([2, 3]), st.integers(0, 80)),
        unique_by=lambda p: p[:2],
        max_size=12,
    ),
    cut=st.integers(0, 12),
)
def test_what_credit_comes_in_goes_out_in_the_same_burst(
    own: set[int],
    complement: set[int],
    signal: set[int],
    signal_credit: int,
    pulses: list[tuple[int, int, int]],
    cut: int,
) -> None:
    cell = wired(*sorted(own), complement=sorted(complement))
    out = cell.receive([start(1, *sorted(signal), credit=signal_credit)])
    assert given_out(out) == len(signal) * share(signal_credit)
    for burst in (pulses[:cut], pulses[cut:]):
        came = sum((share(credit) for _, _, credit in burst), Fraction(0))
        out = cell.receive([pulse(s, t, credit=e) for s, t, e in burst])
        assert given_out(out) == came
        assert sum(r.pulses for r in reports(out)) == len(sent(out))


# State waves --------------------------------------------------------------------------

# Who pulses a literal is the complement of what its complement pulses: where sensor 2
# is off, literal 5 is read, and a cell with the edge 2 -> 4 is pulsed along 5 -> 3.


@pytest.mark.parametrize(("on", "literal"), [(True, OWN), (False, COMPLEMENT)])
def test_in_a_state_wave_it_fires_its_reading(on: bool, literal: int) -> None:
    cell = wired(5, complement=[7])
    out = cell.receive([observation(3, on=on), state_wave(1, 3)])
    (report,) = reports(out)
    assert report.literals == (literal,)
    assert given_out(out) == 1


def test_a_state_wave_waits_for_its_reading() -> None:
    cell = wired(5, complement=[7])
    assert cell.receive([observation(2, on=True), state_wave(1, 3)]) == []
    assert cell.receive([pulse(0, credit=4)]) == []
    out = cell.receive([observation(3, on=False)])
    (report,) = reports(out)
    assert report.literals == (COMPLEMENT, OWN)
    assert given_out(out) == 1 + share(4)


def test_a_repeated_state_wave_names_the_readings_and_waits_for_none() -> None:
    (report,) = reports(wired(5).receive([state_wave(2, 3, 0, COMPLEMENT, 4)]))
    assert report.literals == (COMPLEMENT,)


def test_a_reading_is_latched_once() -> None:
    cell = wired(5)
    cell.receive([observation(3, on=True), observation(3, on=False)])
    (report,) = reports(cell.receive([state_wave(1, 3)]))
    assert report.literals == (OWN,)


def test_it_remembers_the_latest_readings() -> None:
    cell = wired(5)
    for tick in range(1, 30):
        cell.receive([observation(tick, on=True)])
    assert cell.receive([state_wave(1, 2)]) == []
    assert len(reports(cell.receive([state_wave(2, 29)]))) == 1


@pytest.mark.parametrize("bursts", [1, 2, 3])
def test_it_reports_once_all_that_is_sure_to_pulse_it_has(bursts: int) -> None:
    cell = wired(4, 6, complement=[9])
    tick = wire.Observation(3, pack([False, True, False, False, True]))
    # 5 -> 3, 7 -> 3 and 8 -> 2 are due: sensors 2 and 3 are off, and 4 is on.
    due = [pulse(5, COMPLEMENT), pulse(7, COMPLEMENT), pulse(8)]
    fired = cell.receive([tick, state_wave(1, 3)])
    assert [type(m) for m in fired] == [wire.Pulse, wire.Pulse]
    for number in range(bursts - 1):
        assert reports(cell.receive([due[number]])) == []
    (report,) = reports(out := cell.receive(due[bursts - 1 :]))
    assert (report.part, set(report.literals)) == (0, {OWN, COMPLEMENT})
    assert len(report.credit) == 4
    assert report.pulses == 3
    # Whatever else comes is reported as it comes.
    (more,) = reports(cell.receive([pulse(10)]))
    assert (more.part, more.pulses) == (1, 0)
    assert isinstance(out[-1], wire.CellReport)


def test_what_came_before_the_wave_counts_as_come() -> None:
    cell = wired(4)
    tick = wire.Observation(3, pack([False, True, False]))
    assert cell.receive([pulse(5, COMPLEMENT)]) == []
    assert len(reports(cell.receive([tick, state_wave(1, 3)]))) == 1


def test_nobody_waits_for_whose_reading_is_unknown() -> None:
    cell = wired(4, 6)
    bits, known = pack([False, True, False, False]), pack([True, True, True, False])
    assert reports(cell.receive([wire.Observation(3, bits, known=known)])) == []
    assert reports(cell.receive([state_wave(1, 3)])) == []
    (report,) = reports(cell.receive([pulse(5, COMPLEMENT)]))
    assert report.literals == (OWN, COMPLEMENT)


def test_of_a_repeated_state_wave_each_burst_is_reported() -> None:
    cell = wired(4)
    tick = wire.Observation(3, pack([False, True, False]))
    cell.receive([tick, state_wave(1, 3)])
    assert len(reports(cell.receive([state_wave(2, 3, OWN)]))) == 1
    assert len(reports(cell.receive([pulse(5, COMPLEMENT, wave=2)]))) == 1


# What comes again ---------------------------------------------------------------------


def test_a_message_that_comes_again_changes_nothing() -> None:
    messages = [
        wire.Wiring(1, 2, 1, add=(6,)),
        observation(1, on=True),
        wire.WaveStart(1, 1, "state", 2, 1, fence=1),
        pulse(0, credit=2),
        pulse(0, COMPLEMENT, credit=2),
        wire.WaveStart(2, 1, "signal", 1, 1, (0, 3), fence=1, cell=1),
        pulse(4, wave=2, fence=1),
        pulse(4, wave=3, fence=1),
        wire.Wiring(1, 3, 2, drop=(6,)),
        observation(2, on=False),
        wire.WaveStart(4, 2, "state", 2, 3, fence=4),
    ]
    once, often = wired(4), wired(4)
    for number, message in enumerate(messages):
        expected = once.receive([message])
        assert often.receive([message]) == expected
        for earlier in messages[: number + 1]:
            assert often.receive([earlier]) == []


def test_a_pulse_that_comes_again_while_held_counts_once() -> None:
    cell = wired(4)
    cell.receive([pulse(0, credit=2), pulse(0, credit=2)])
    assert given_out(cell.receive([start()])) == share(2)


# Unknown readings ---------------------------------------------------------------------


def partly(tick: int, *known: int) -> wire.Message:
    """An observation of which only these of three sensors are known: they are on."""
    bits = pack([sensor in known for sensor in range(3)])
    return wire.Observation(tick, bits, known=bits)


def test_a_cell_whose_reading_is_unknown_starts_no_wave_and_passes_pulses_on() -> None:
    cell = wired(4)
    assert cell.receive([partly(1, 0, 2), state_wave(1, 1)]) == []
    out = cell.receive([pulse(0, credit=2)])
    assert [(p.target, p.hops) for p in sent(out)] == [(4, 2)]
    assert given_out(out) == share(2)


def test_it_holds_pulses_until_it_knows_that_its_reading_is_unknown() -> None:
    cell = wired(4)
    assert cell.receive([state_wave(1, 1), pulse(0)]) == []
    assert len(sent(cell.receive([partly(1, 0, 2)]))) == 1


def test_a_known_reading_among_unknown_ones_starts_a_wave() -> None:
    (report,) = reports(wired().receive([partly(1, 1), state_wave(1, 1)]))
    assert report.literals == (OWN,)


def test_what_was_not_observed_does_not_fire_in_a_repeat_either() -> None:
    assert wired(4).receive([state_wave(1, 1, 0, 5)]) == []


@pytest.mark.parametrize(
    ("bits", "known", "what"),
    [
        (b"\x02", b"\x02\x00", "must say which of 1 bytes are known, got 2 bytes"),
        (b"\x02", b"\x05", "must be 0 where it is not known, got sensor 1 on"),
        (b"\x00", b"\x00", "must hold a reading that is known, got none"),
    ],
)
def test_an_observation_that_contradicts_itself_is_a_fault(
    bits: bytes, known: bytes, what: str
) -> None:
    cell = wired(5)
    wrong = wire.Observation(1, bits, known=known)
    assert cell.receive([wrong]) == [wire.Fault("cell/1", f"observation: {what}")]
    (report,) = reports(cell.receive([observation(1, on=False), state_wave(1, 1)]))
    assert report.literals == (COMPLEMENT,)


# What is not for it -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (pulse(0, 4), "pulse: must be for this cell, got 4"),
        (wire.Wiring(2, 5, 0, add=(4,)), "wiring: must be for this cell, got 2"),
        (wire.Observation(1, b""), "observation: must hold sensor 1, got 0 bytes"),
        (wire.Decision(1, 0, "?"), "decision: is not for a cell"),
        (wire.CellReport(1, 0, 0, (), (), (), 0), "cellreport: is not for a cell"),
    ],
    ids=["pulse", "wiring", "observation", "decision", "report"],
)
def test_what_is_not_for_it_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    cell = wired(4)
    assert cell.receive([start(1), message]) == [wire.Fault("cell/1", what)]
    assert cell.receive([pulse(0)]) == [
        wire.Pulse(1, OWN, 4, 2, 4, 1),
        wire.CellReport(1, 1, 0, (OWN,), (1,), (4,), 1, epoch=1),
    ]


@given(
    st.lists(
        st.builds(
            wire.Pulse,
            st.integers(1, 4),
            st.integers(0, 9),
            st.integers(0, 9),
            st.integers(1, 9),
            st.integers(0, 9),
            st.integers(0, 4),
        )
        | st.builds(
            wire.WaveStart,
            st.integers(1, 4),
            st.integers(0, 3),
            st.sampled_from(["state", "signal"]),
            st.integers(0, 5),
            st.integers(1, 4),
            st.lists(st.integers(0, 9)).map(tuple),
            st.just(0),
            st.integers(0, 4),
            st.sampled_from([-1, 1]),
        )
        | st.builds(wire.Observation, st.integers(1, 12), st.binary(max_size=2))
        | st.builds(
            wire.Wiring,
            st.integers(0, 2),
            st.integers(1, 5),
            st.integers(0, 4),
            st.lists(st.integers(0, 9)).map(tuple),
            st.lists(st.integers(0, 9)).map(tuple),
        ),
        max_size=30,
    )
)
@example(
    [
        wire.WaveStart(2, 0, "state", 2, 3),
        wire.WaveStart(2, 0, "state", 0, 1, (2,)),
        wire.Pulse(1, 0, 0, 1, 0, 0),
    ]
)
def test_no_message_is_an_exception_and_no_credit_is_made(
    messages: list[wire.Message],
) -> None:
    cell = Cell(1)
    came: dict[int, Fraction] = {}
    went: dict[int, Fraction] = {}
    starts: dict[int, wire.WaveStart] = {}
    ways = set()
    for message in messages:
        if isinstance(message, wire.Pulse):
            way = (message.wave, message.source, message.target)
            if way not in ways:
                ways.add(way)
                came[message.wave] = came.get(message.wave, Fraction(0)) + share(
                    message.credit
                )
        elif (
            isinstance(message, wire.WaveStart)
            and message.wave not in starts
            and message.settled_below <= message.wave  # else it is refused
        ):
            starts[message.wave] = message
            came[message.wave] = came.get(message.wave, Fraction(0)) + 2 * share(
                message.credit
            )
        out = cell.receive([message])
        for wave in {p.wave for p in sent(out)} | {r.wave for r in reports(out)}:
            mine: list[wire.Message] = [p for p in sent(out) if p.wave == wave]
            mine += [r for r in reports(out) if r.wave == wave]
            went[wave] = went.get(wave, Fraction(0)) + given_out(mine)
    assert all(went[wave] <= came[wave] for wave in went)
