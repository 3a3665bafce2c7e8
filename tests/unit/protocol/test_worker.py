"""One worker, message by message, and against the cells it stands for.

The worker under test is the second of three, over nine sensors: its cells are 3 to 5,
its literals 6 to 11.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.credit import split_evenly
from neurosnap.protocol.partition import shares
from neurosnap.protocol.wave import DEEPEST
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_kernels import (
    Fired,
    Ints,
    Net,
    Pulses,
    carried,
    outgoing,
    split,
)
from neurosnap.sensorium import pack

SENSORS, WORKERS, ME = 9, 3, 1
HOSTED = shares(SENSORS, WORKERS)
Edges = Iterable[tuple[int, int]]


def packed(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(4, "little", signed=True) for number in numbers)


def edges(pairs: Edges) -> bytes:
    return packed(*(literal for pair in sorted(pairs) for literal in pair))


def wired(*pairs: tuple[int, int]) -> Worker:
    """Return the worker under test with out-edges."""
    worker = Worker(ME, HOSTED)
    assert worker.receive([wire.WorkerWiring(ME, 1, 0, edges(pairs))]) == []
    return worker


def start(wave: int = 1, *signal: int, credit: int = 0, below: int = 1) -> wire.Message:
    return wire.WaveStart(wave, 0, "signal", credit, below, signal, fence=wave)


def state_wave(wave: int, tick: int, *signal: int) -> wire.Message:
    return wire.WaveStart(wave, tick, "state", 4, 1, signal, fence=wave)


def burst(
    *pulses: tuple[int, int, int, int], wave: int = 1, worker: int = 0, part: int = 0
) -> wire.PulseBatch:
    """Return pulses to the worker under test: source, target, hops, credit each."""
    fields = [packed(*field) for field in zip(*pulses, strict=True)]
    return wire.PulseBatch(wave, worker, ME, part, *fields)


def observation(tick: int, *on: int) -> wire.Message:
    return wire.Observation(tick, pack([cell in on for cell in range(SENSORS)]))


def pulses_in(message: wire.PulseBatch) -> list[tuple[int, int, int, int]]:
    fields = (message.sources, message.targets, message.hops, message.credit)
    columns = [wire.numbers("field", field) for field in fields]
    return list(zip(*columns, strict=True))


def fired_in(tally: wire.WorkerReport) -> dict[int, int]:
    hops = wire.numbers("hops", tally.hops)
    return dict(zip(wire.fired(tally), hops, strict=True))


def share(credit: int) -> Fraction:
    return Fraction(1, 2**credit)


# Firing -------------------------------------------------------------------------------


def test_pulses_among_its_own_cells_stay_inside() -> None:
    worker = wired((6, 8), (8, 10))
    assert worker.receive([start(1, 6)]) == [
        wire.WorkerReport(1, ME, 0, packed(6, 8, 10), packed(0, 1, 2), (0,), 2, epoch=1)
    ]


def test_pulses_to_others_leave_in_one_burst_each_before_the_report() -> None:
    worker = wired((6, 0), (6, 4), (6, 17), (9, 16))
    assert worker.receive([start(1, 6, 9, credit=1)]) == [
        wire.PulseBatch(
            1, ME, 0, 0, packed(6, 6), packed(0, 4), packed(1, 1), packed(3, 3)
        ),
        wire.PulseBatch(
            1, ME, 2, 0, packed(6, 9), packed(17, 16), packed(1, 1), packed(3, 2)
        ),
        wire.WorkerReport(1, ME, 0, packed(6, 9), packed(0, 0), (2, 3), 4, epoch=1),
    ]


def test_the_fewest_hops_in_a_burst_count_whatever_came_first() -> None:
    worker = wired((6, 8), (8, 10))
    far = burst((0, 8, 7, 3), (0, 10, 3, 3), (2, 6, 1, 3))
    (tally,) = worker.receive([start(), far])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 1, 8: 2, 10: 3}
    assert sum(map(share, tally.credit)) == 3 * share(3)


@given(
    st.lists(
        st.sampled_from([True, False, None]), min_size=SENSORS, max_size=SENSORS
    ).filter(lambda row: any(on is not None for on in row))
)
def test_of_the_readings_those_of_its_cells_that_are_known_fire(
    row: list[bool | None],
) -> None:
    worker, cells = Worker(ME, HOSTED), [Cell(cell) for cell in HOSTED[ME]]
    told = wire.Observation(
        1,
        pack([on is True for on in row]),
        known=pack([on is not None for on in row]),
    )
    expected = {
        2 * cell + (row[cell] is False): 0
        for cell in HOSTED[ME]
        if row[cell] is not None
    }
    said = worker.receive([told, state_wave(1, 1)])
    fired = [fired_in(tally) for tally in said if isinstance(tally, wire.WorkerReport)]
    assert fired == ([expected] if expected else [])
    by_cells = [m for cell in cells for m in cell.receive([told, state_wave(1, 1)])]
    literals = [m.literals for m in by_cells if isinstance(m, wire.CellReport)]
    assert sorted(literals) == [(literal,) for literal in sorted(expected)]


def test_a_worker_of_unknown_readings_only_passes_pulses_on() -> None:
    worker = wired((6, 8))
    unknown = wire.Observation(1, b"\x01\x00", known=b"\x01\x00")
    assert worker.receive([unknown, state_wave(1, 1)]) == []
    (tally,) = worker.receive([burst((0, 6, 1, 5))])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 1, 8: 2}


def test_an_observation_that_contradicts_itself_is_a_fault() -> None:
    wrong = wire.Observation(1, b"\x01\x00", known=b"\x02\x00")
    what = "observe: must be 0 where it is not known, got sensor 0 on"
    assert wired().receive([wrong]) == [wire.Fault("worker/1", what)]


def test_it_says_by_which_frame_it_acted_and_what_comes_after_does_not_count() -> None:
    worker = wired((6, 8))
    changed = wire.WorkerWiring(ME, 2, 1, edges([(6, 10)]), edges([(6, 8)]))
    assert worker.receive([start(1, 6), changed, start(2, 6)]) == [
        wire.WorkerReport(1, ME, 0, packed(6, 8), packed(0, 1), (0,), 1, epoch=1),
        wire.WorkerReport(2, ME, 0, packed(6, 10), packed(0, 1), (0,), 1, epoch=2),
    ]


def test_it_fires_once_a_wave_and_again_in_another() -> None:
    worker = wired((6, 8))
    worker.receive([start(1, 6)])
    (tally,) = worker.receive([burst((0, 6, 4, 5))])
    assert tally == wire.WorkerReport(1, ME, 1, b"", b"", (5,), 0, epoch=1)
    (tally,) = worker.receive([start(2, 6)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 8: 1}


def test_a_signal_that_asks_others_leaves_it_silent() -> None:
    assert wired((6, 8)).receive([start(1, 0, 5, 12)]) == []


def test_bursts_to_a_worker_are_numbered_by_wave() -> None:
    worker = wired((6, 0), (8, 0), (10, 12))
    messages: list[wire.Message] = []
    for burst_ in ([start(1, 6)], [burst((0, 8, 1, 1)), burst((0, 10, 1, 1), part=1)]):
        messages += worker.receive(burst_)
    messages += worker.receive([start(2, 6)])
    numbered = [
        (m.wave, m.to, m.part) for m in messages if isinstance(m, wire.PulseBatch)
    ]
    assert numbered == [(1, 0, 0), (1, 0, 1), (1, 2, 0), (2, 0, 0)]
    tallies = [(m.wave, m.part) for m in messages if isinstance(m, wire.WorkerReport)]
    assert tallies == [(1, 0), (1, 1), (2, 0)]


# Fences -------------------------------------------------------------------------------


def test_pulses_wait_for_their_wave() -> None:
    worker = wired((6, 8))
    early = burst((0, 6, 1, 1))
    assert worker.receive([early]) == []
    (tally,) = worker.receive([start()])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 1, 8: 2}


def test_a_state_wave_waits_for_its_reading() -> None:
    worker = wired((6, 8))
    assert worker.receive([state_wave(1, 1), burst((0, 10, 1, 1))]) == []
    (tally,) = worker.receive([observation(1, 3)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 9: 0, 11: 0, 8: 1, 10: 1}


def test_a_repeated_state_wave_says_what_was_observed() -> None:
    (tally,) = wired().receive([state_wave(2, 1, 1, 7, 8, 11, 12)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {7: 0, 8: 0, 11: 0}


def test_readings_are_kept_by_tick() -> None:
    worker = wired()
    worker.receive([observation(1, 3), observation(2, 4), observation(1, 5)])
    out = worker.receive([state_wave(1, 1), state_wave(2, 2)])
    found = [set(wire.fired(m)) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [{6, 9, 11}, {7, 8, 11}]


def test_a_wave_that_settled_is_forgotten() -> None:
    worker = wired((6, 8))
    worker.receive([start(1, 6), start(2, 8, below=2)])
    assert worker.receive([burst((0, 6, 1, 1)), start(1, 6)]) == []
    assert len(worker._waves) == 1


# Wiring -------------------------------------------------------------------------------


def test_wirings_build_on_each_other() -> None:
    worker = wired((6, 8), (6, 10))
    more, less = edges([(6, 7), (6, 9)]), edges([(6, 8), (6, 11)])
    assert worker.receive([wire.WorkerWiring(ME, 2, 1, more, less)]) == []
    (tally,) = worker.receive([start(1, 6)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 7: 1, 9: 1, 10: 1}


def test_a_whole_wiring_forgets_what_was() -> None:
    worker = wired((6, 8))
    worker.receive([wire.WorkerWiring(ME, 5, 0, edges([(6, 10)]))])
    (tally,) = worker.receive([start(1, 6)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 10: 1}


def test_a_wave_goes_along_the_wiring_it_was_announced_after() -> None:
    change = wire.WorkerWiring(ME, 2, 1, b"", edges([(6, 8)]))
    out = wired((6, 8)).receive([start(1, 6), change, start(2, 6)])
    found = [fired_in(m) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [{6: 0, 8: 1}, {6: 0}]


def test_after_a_lost_frame_it_is_silent_until_wired_anew() -> None:
    worker = wired((6, 8))
    (fault,) = worker.receive([wire.WorkerWiring(ME, 3, 2, edges([(6, 10)]))])
    assert fault == wire.Fault("worker/1", "loom: must build on epoch 1, got 2")
    assert worker.receive([start(1, 6), burst((0, 8, 1, 1))]) == []
    out = worker.receive([wire.WorkerWiring(ME, 4, 0, edges([(6, 10)]))])
    (tally,) = out
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 8: 1, 10: 1}


# What came before, and what cannot be right ------------------------------------------


def test_what_came_before_changes_nothing() -> None:
    worker = wired((6, 8), (8, 0))
    said: list[wire.Message] = [
        wire.WorkerWiring(ME, 2, 1, edges([(10, 0)])),
        observation(1, 3),
        state_wave(1, 1),
        burst((0, 8, 1, 1)),
        burst((0, 10, 1, 1), part=1),
        burst((12, 10, 1, 1), worker=2),
    ]
    assert worker.receive(said)
    assert worker.receive(said) == []


WRONG: list[tuple[wire.Message, str]] = [
    (wire.Pulse(1, 0, 6, 1, 0), "excite: is not for a worker"),
    (wire.WorkerWiring(0, 2, 1), "loom: must be for this worker, got 0"),
    (
        wire.WorkerWiring(ME, 4098, 0),
        "loom: epoch must be at most 4096 beyond 1, got 4098",
    ),
    (
        wire.WorkerWiring(ME, 2, 1, packed(6)),
        "loom: add: must be eight bytes an edge, got 4",
    ),
    (
        wire.WorkerWiring(ME, 2, 1, b"", packed(4, 6)),
        "loom: drop must lead from 6 to 11, got 4 to 4",
    ),
    (
        wire.WorkerWiring(ME, 2, 1, packed(6, 18)),
        "loom: add must lead to 0 to 17, got 18 to 18",
    ),
    (
        wire.WorkerWiring(ME, 2, 1, packed(6, -1)),
        "loom: add must lead to 0 to 17, got -1 to -1",
    ),
    (
        wire.WorkerWiring(ME, 2, 1, packed(6, 8, 6, 8)),
        "loom: add must be ascending, got a step that is not",
    ),
    (
        wire.WaveStart(2, 0, "signal", 0, 1, (6,), cell=3),
        "wave: must be for all, got one for cell 3",
    ),
    (start(2, 6, credit=DEEPEST + 1), "wave: must have credit up to"),
    (start(2, 6, below=3), "wave: must settle only what is before wave 2, got all"),
    (start(10_000, 6), "wave: wave must be at most 4096 beyond 1, got 10000"),
    (state_wave(2, 50), "wave: tick must be at most 8 ticks after 1, got 50"),
    (observation(50), "observe: tick must be at most 8 ticks after 1, got 50"),
    (wire.Observation(2, b"\0"), "observe: must hold 2 bytes, got 1"),
    (
        msgspec.structs.replace(burst((0, 6, 1, 1)), to=2),
        "burst: must be for this worker, got 2",
    ),
    (burst((6, 6, 1, 1), worker=1), "burst: must be another worker's, got 1"),
    (burst((0, 6, 1, 1), worker=3), "burst: must be another worker's, got 3"),
    (burst((12, 6, 1, 1)), "burst: sources must be 0 to 5, got 12 to 12"),
    (burst((0, 6, 1, 1), (0, 12, 1, 1)), "burst: targets must be 6 to 11, got 6 to 12"),
    (burst((0, 6, 0, 1)), "burst: hops must be 1 to"),
    (burst((0, 6, DEEPEST + 1, 1)), "burst: hops must be 1 to"),
    (burst((0, 6, 1, -1)), "burst: credit must be 0 to"),
    (burst((0, 6, 1, DEEPEST + 1)), "burst: credit must be 0 to"),
    (burst((0, 6, 1, 1), wave=10_000), "burst: wave must be at most 4096 beyond 1"),
    (
        msgspec.structs.replace(burst((0, 6, 1, 1)), hops=packed(1, 1)),
        "burst: must be whole pulses, got [1, 2]",
    ),
    (
        wire.PulseBatch(1, 0, ME, 0, b"", b"", b"", b""),
        "burst: must be whole pulses, got [0]",
    ),
    (
        msgspec.structs.replace(burst((0, 6, 1, 1)), hops=b"\1"),
        "burst: hops: must be four bytes a number, got 1",
    ),
]


@pytest.mark.parametrize(("message", "what"), WRONG, ids=[what for _, what in WRONG])
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    workers = [wired((6, 8), (8, 0)), wired((6, 8), (8, 0))]
    before: list[wire.Message] = [observation(1, 3), state_wave(1, 1)]
    after: list[wire.Message] = [
        burst((0, 10, 1, 1)),
        start(2, 6),
        observation(2),
        state_wave(3, 2),
        wire.WorkerWiring(ME, 2, 1, edges([(6, 10)])),
        start(4, 6),
    ]
    for worker in workers:
        worker.receive(before)
    (fault,) = workers[0].receive([message])
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(what)
    assert workers[0].receive(after) == workers[1].receive(after)


def test_more_pulses_than_may_wait_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("neurosnap.protocol.worker._HELD", 3)
    worker = wired()
    held = burst((0, 6, 1, 1), (0, 8, 1, 1))
    assert worker.receive([held]) == []
    more = burst((0, 6, 1, 1), (0, 8, 1, 1), wave=2)
    (fault,) = worker.receive([more])
    assert fault == wire.Fault("worker/1", "burst: must leave up to 3 pulses waiting")
    (tally,) = worker.receive([start()])
    assert isinstance(tally, wire.WorkerReport)
    # Those wait no more, and those of a wave that is forgotten do not either.
    assert worker.receive([more]) == []
    (tally,) = worker.receive([start(3, 6, below=3)])
    assert isinstance(tally, wire.WorkerReport)
    assert worker.receive([burst((0, 6, 1, 1), (0, 8, 1, 1), wave=4)]) == []


def test_what_stays_here_is_gathered_for_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gathered: list[int] = []

    def noting(net: Net, reached: Ints, fired: Fired, to: int) -> Pulses:
        gathered.append(to)
        return outgoing(net, reached, fired, to)

    monkeypatch.setattr("neurosnap.protocol.worker.outgoing", noting)
    worker = wired((6, 8), (6, 12))
    assert len(worker.receive([start(1, 6)])) == 2
    assert gathered == [0, 2]


def test_more_bursts_than_are_remembered_are_refused_until_waves_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.worker._BURSTS", 2)
    worker = wired()
    worker.receive([start(1, 6)])
    for part in (0, 1):
        worker.receive([burst((0, 8, 1, 1), part=part)])
    said = worker.receive([burst((0, 8, 1, 1), part=2)])
    what = "burst: must be one of 2 in flight, got one more"
    assert said == [wire.Fault("worker/1", what)]
    worker.receive([start(2, 6, below=2)])
    (tally,) = worker.receive([burst((0, 8, 1, 1), wave=2)])
    assert isinstance(tally, wire.WorkerReport)


def test_more_waves_than_may_be_in_flight_are_refused_until_some_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.message_checks.WAVES", 3)
    worker = wired()
    waiting = [burst((0, 8, 1, 1), wave=wave) for wave in (2, 3, 4, 5)]
    (fault,) = worker.receive(waiting)
    what = "burst: must be of 3 waves in all, got wave 5 too"
    assert fault == wire.Fault("worker/1", what)
    (fault,) = worker.receive([start(1, 6)])
    what = "wave: must be of 3 waves in all, got wave 1 too"
    assert fault == wire.Fault("worker/1", what)
    # What a wave settles makes room for it.
    (tally,) = worker.receive([start(5, 6, below=3)])
    assert isinstance(tally, wire.WorkerReport)
    assert set(worker._waves) == {3, 4, 5}


def test_a_frame_that_is_only_just_near_enough_is_taken() -> None:
    worker = wired((6, 8))
    assert worker.receive([wire.WorkerWiring(ME, 4097, 0, edges([(6, 10)]))]) == []
    (tally,) = worker.receive([start(1, 6)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {6: 0, 10: 1}


def test_of_a_signal_only_its_own_literals_are_kept_each_once() -> None:
    worker = wired()
    worker.receive([wire.WorkerWiring(ME, 3, 2)])  # a change was lost: the waves wait
    signal = tuple(range(2 * SENSORS)) * 1000
    worker.receive([start(1, *signal), state_wave(2, 1, *signal)])
    kept = [wave.start for wave in worker._waves.values()]
    assert [one and one.signal for one in kept] == [tuple(range(6, 12))] * 2
    out = worker.receive([wire.WorkerWiring(ME, 4, 0)])
    found = [fired_in(m) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [dict.fromkeys(range(6, 12), 0)] * 2


def test_a_literal_named_twice_fires_once_as_it_does_in_a_cell() -> None:
    begin = start(1, 6, 6, 6, credit=3)
    said = wired((6, 0)).receive([begin])
    assert summed(said) == summed(Cells([(6, 0)]).receive([begin]))


# Credit -------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.integers(1, 3000))
def test_credit_is_split_as_a_cell_splits_it(credit: int, parts: int) -> None:
    larger, exponent = split(credit, parts)
    shares_ = [exponent - (number < larger) for number in range(parts)]
    assert shares_ == split_evenly(credit, parts)


@given(st.lists(st.integers(0, 90), min_size=1, max_size=60), st.integers(1, 40))
def test_shares_are_added_up_until_each_comes_once(
    exponents: list[int], room: int
) -> None:
    least = min(exponents)
    back = np.bincount(np.array(exponents) - least, minlength=room).astype(np.int64)
    total = sum(map(share, exponents))
    left = carried(back, least)
    assert list(left) == sorted(left)
    if total <= 1:
        assert sum(map(share, left)) == total
        assert len(set(left)) == len(left)
    else:  # no wave has so much, and what is said cannot be taken for less
        assert sum(map(share, left)) > 1


def test_a_chain_of_thousands_splits_its_credit_to_the_end() -> None:
    length = 5000
    worker = Worker(0, shares(length, 1))
    pairs = [(2 * cell, 2 * cell + 2) for cell in range(length - 1)]
    worker.receive([wire.WorkerWiring(0, 1, 0, edges(pairs))])
    (tally,) = worker.receive([start(1, 0)])
    assert isinstance(tally, wire.WorkerReport)
    assert fired_in(tally) == {2 * cell: cell for cell in range(length)}
    assert (tally.credit, tally.pulses) == ((0,), length - 1)


# Against cells ------------------------------------------------------------------------

literals = st.integers(0, 2 * SENSORS - 1)


class Cells:
    """The cells of one worker, which pass on among themselves, first come, first."""

    def __init__(self, pairs: Sequence[tuple[int, int]]) -> None:
        self.cells = {number: Cell(number) for number in HOSTED[ME]}
        for number, cell in self.cells.items():
            add, more = (
                tuple(sorted(b for a, b in pairs if a == literal))
                for literal in (2 * number, 2 * number + 1)
            )
            cell.receive([wire.Wiring(number, 1, 0, add=add, add_complement=more)])

    def receive(self, said: Sequence[wire.Message]) -> list[wire.Message]:
        """Return what leaves, and the reports."""
        out: list[wire.Message] = []
        waiting = deque(
            (cell, message)
            for message in said
            for cell in self.cells.values()
            if not isinstance(message, wire.Pulse) or message.target >> 1 == cell.cell
        )
        while waiting:
            cell, message = waiting.popleft()
            for answer in cell.receive([message]):
                inside = isinstance(answer, wire.Pulse) and (
                    answer.target >> 1 in self.cells
                )
                if inside and isinstance(answer, wire.Pulse):
                    waiting.append((self.cells[answer.target >> 1], answer))
                else:
                    out.append(answer)
        return out


def summed(messages: Iterable[wire.Message]) -> dict[str, Any]:
    """What was said of a wave, whoever said it in whatever messages."""
    hops: dict[int, int] = {}
    leaving, back, pulses = [], Fraction(0), 0
    for message in messages:
        match message:
            case wire.Pulse():
                leaving.append(
                    (message.source, message.target, message.hops, message.credit)
                )
            case wire.PulseBatch():
                leaving += pulses_in(message)
            case wire.CellReport():
                hops |= zip(message.literals, message.hops, strict=True)
            case wire.WorkerReport():
                hops |= fired_in(message)
        if isinstance(message, wire.CellReport | wire.WorkerReport):
            back += sum(map(share, message.credit))
            pulses += message.pulses
    return {"hops": hops, "leaving": sorted(leaving), "back": back, "pulses": pulses}


@given(
    pairs=st.lists(st.tuples(st.integers(6, 11), literals), max_size=25, unique=True),
    signal=st.lists(literals, max_size=4, unique=True),
    coming=st.lists(
        st.tuples(st.integers(0, 5), st.integers(6, 11), st.integers(2, 4)),
        max_size=6,
        unique_by=lambda pulse: pulse[:2],
    ),
)
def test_it_says_what_its_cells_would(
    pairs: list[tuple[int, int]],
    signal: list[int],
    coming: list[tuple[int, int, int]],
) -> None:
    # One after the other, and with hops that make the first also the shortest way: then
    # nothing is left to chance, neither among cells nor in a worker.
    worker, cells = wired(*pairs), Cells(pairs)
    begin = start(1, *sorted(signal), credit=4)
    assert summed(worker.receive([begin])) == summed(cells.receive([begin]))
    for part, (source, target, credit) in enumerate(coming):
        hops = 20 * (part + 1)
        one = burst((source, target, hops, credit), part=part)
        same = wire.Pulse(1, source, target, hops, credit, 1)
        assert summed(worker.receive([one])) == summed(cells.receive([same]))


@given(
    pairs=st.lists(st.tuples(st.integers(6, 11), literals), max_size=25, unique=True),
    signal=st.lists(st.integers(6, 11), max_size=4, unique=True),
    coming=st.lists(
        st.tuples(
            st.integers(0, 5), st.integers(6, 11), st.integers(1, 9), st.integers(2, 90)
        ),
        max_size=12,
    ),
)
def test_it_takes_the_shortest_ways_and_keeps_the_credit(
    pairs: list[tuple[int, int]],
    signal: list[int],
    coming: list[tuple[int, int, int, int]],
) -> None:
    said = [start(1, *signal, credit=2), *([burst(*coming)] if coming else [])]
    found = summed(wired(*pairs).receive(said))
    # Relaxing every edge as often as there are literals gives the shortest ways.
    hops = dict.fromkeys(signal, 0)
    for _, target, far, _ in sorted(coming, key=lambda pulse: -pulse[2]):
        hops[target] = min(far, hops.get(target, far))
    for _ in range(2 * SENSORS):
        for a, b in pairs:
            if a in hops and 6 <= b <= 11:
                hops[b] = min(hops.get(b, hops[a] + 1), hops[a] + 1)
    assert found["hops"] == hops
    assert found["pulses"] == sum(a in hops for a, _ in pairs)
    outside = [(a, b, hops[a] + 1) for a, b in pairs if a in hops and not 6 <= b <= 11]
    assert [pulse[:3] for pulse in found["leaving"]] == sorted(outside)
    came = len(signal) * share(2) + sum(share(credit) for *_, credit in coming)
    left = sum(share(credit) for *_, credit in found["leaving"])
    if came <= 1:
        assert left + found["back"] == came
