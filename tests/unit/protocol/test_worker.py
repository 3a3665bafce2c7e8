"""One worker, message by message."""

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.partition import shares
from neurosnap.protocol.worker import Worker
from neurosnap.sensorium import pack
from tests.support.wave_messages import packed, share, start, state_wave
from tests.support.worker_messages import (
    HOSTED,
    ME,
    SENSORS,
    batch,
    edges,
    fired_by,
    fired_in,
    observation,
    pulses_in,
    wired,
)

# Firing -------------------------------------------------------------------------------


def test_pulses_among_its_own_cells_stay_inside() -> None:
    worker = wired((6, 8), (8, 10))
    assert worker.receive([start(1, 6)]) == [
        wire.WorkerReport(1, ME, 0, packed(6, 8, 10), packed(0, 1, 2), (0,), 2, epoch=1)
    ]


def test_pulses_to_others_leave_in_one_batch_each_before_the_report() -> None:
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


def test_the_fewest_hops_in_a_somecount_whatever_came_first() -> None:
    worker = wired((6, 8), (8, 10))
    far = batch((0, 8, 7, 3), (0, 10, 3, 3), (2, 6, 1, 3))
    (report,) = worker.receive([start(), far])
    assert isinstance(report, wire.WorkerReport)
    assert fired_in(report) == {6: 1, 8: 2, 10: 3}
    assert sum(map(share, report.credit)) == 3 * share(3)


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
    said = worker.receive([told, state_wave(1, 1, credit=4)])
    fired = [
        fired_in(report) for report in said if isinstance(report, wire.WorkerReport)
    ]
    assert fired == ([expected] if expected else [])
    by_cells = [
        m for cell in cells for m in cell.receive([told, state_wave(1, 1, credit=4)])
    ]
    literals = [m.literals for m in by_cells if isinstance(m, wire.CellReport)]
    assert sorted(literals) == [(literal,) for literal in sorted(expected)]


def test_a_worker_of_unknown_readings_only_passes_pulses_on() -> None:
    worker = wired((6, 8))
    unknown = wire.Observation(1, b"\x01\x00", known=b"\x01\x00")
    assert worker.receive([unknown, state_wave(1, 1, credit=4)]) == []
    assert fired_by(worker, batch((0, 6, 1, 5))) == {6: 1, 8: 2}


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
    (report,) = worker.receive([batch((0, 6, 4, 5))])
    assert report == wire.WorkerReport(1, ME, 1, b"", b"", (5,), 0, epoch=1)
    assert fired_by(worker, start(2, 6)) == {6: 0, 8: 1}


def test_a_signal_that_asks_others_leaves_it_silent() -> None:
    assert wired((6, 8)).receive([start(1, 0, 5, 12)]) == []


def test_batches_to_a_worker_are_numbered_by_wave() -> None:
    worker = wired((6, 0), (8, 0), (10, 12))
    messages: list[wire.Message] = []
    for some in ([start(1, 6)], [batch((0, 8, 1, 1)), batch((0, 10, 1, 1), part=1)]):
        messages += worker.receive(some)
    messages += worker.receive([start(2, 6)])
    numbered = [
        (m.wave, m.to, m.part) for m in messages if isinstance(m, wire.PulseBatch)
    ]
    assert numbered == [(1, 0, 0), (1, 0, 1), (1, 2, 0), (2, 0, 0)]
    reports = [(m.wave, m.part) for m in messages if isinstance(m, wire.WorkerReport)]
    assert reports == [(1, 0), (1, 1), (2, 0)]


# Fences -------------------------------------------------------------------------------


def test_pulses_wait_for_their_wave() -> None:
    worker = wired((6, 8))
    early = batch((0, 6, 1, 1))
    assert worker.receive([early]) == []
    assert fired_by(worker, start()) == {6: 1, 8: 2}


def test_a_state_wave_waits_for_its_reading() -> None:
    worker = wired((6, 8))
    assert worker.receive([state_wave(1, 1, credit=4), batch((0, 10, 1, 1))]) == []
    assert fired_by(worker, observation(1, 3)) == {6: 0, 9: 0, 11: 0, 8: 1, 10: 1}


def test_a_repeated_state_wave_says_what_was_observed() -> None:
    assert fired_by(wired(), state_wave(2, 1, 1, 7, 8, 11, 12, credit=4)) == {
        7: 0,
        8: 0,
        11: 0,
    }


def test_readings_are_kept_by_tick() -> None:
    worker = wired()
    worker.receive([observation(1, 3), observation(2, 4), observation(1, 5)])
    out = worker.receive([state_wave(1, 1, credit=4), state_wave(2, 2, credit=4)])
    found = [set(wire.fired(m)[0]) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [{6, 9, 11}, {7, 8, 11}]


def test_a_wave_that_settled_is_forgotten() -> None:
    worker = wired((6, 8))
    worker.receive([start(1, 6), start(2, 8, below=2)])
    assert worker.receive([batch((0, 6, 1, 1)), start(1, 6)]) == []
    assert len(worker._waves) == 1


# Wiring -------------------------------------------------------------------------------


def test_wirings_build_on_each_other() -> None:
    worker = wired((6, 8), (6, 10))
    more, less = edges([(6, 7), (6, 9)]), edges([(6, 8), (6, 11)])
    assert worker.receive([wire.WorkerWiring(ME, 2, 1, more, less)]) == []
    assert fired_by(worker, start(1, 6)) == {6: 0, 7: 1, 9: 1, 10: 1}


def test_a_whole_wiring_forgets_what_was() -> None:
    worker = wired((6, 8))
    worker.receive([wire.WorkerWiring(ME, 5, 0, edges([(6, 10)]))])
    assert fired_by(worker, start(1, 6)) == {6: 0, 10: 1}


def test_a_wave_goes_along_the_wiring_it_was_announced_after() -> None:
    change = wire.WorkerWiring(ME, 2, 1, b"", edges([(6, 8)]))
    out = wired((6, 8)).receive([start(1, 6), change, start(2, 6)])
    found = [fired_in(m) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [{6: 0, 8: 1}, {6: 0}]


def test_a_change_of_a_wiring_that_was_replaced_is_refused() -> None:
    worker = wired((6, 8))
    worker.receive([wire.WorkerWiring(ME, 2, 1, edges([(6, 10)]))])
    (fault,) = worker.receive([wire.WorkerWiring(ME, 3, 1, edges([(6, 4)]))])
    assert fault == wire.Fault("worker/1", "workerwiring: must build on epoch 2, got 1")


def test_after_a_lost_frame_it_is_silent_until_wired_anew() -> None:
    worker = wired((6, 8))
    (fault,) = worker.receive([wire.WorkerWiring(ME, 3, 2, edges([(6, 10)]))])
    assert fault == wire.Fault("worker/1", "workerwiring: must build on epoch 1, got 2")
    assert worker.receive([start(1, 6), batch((0, 8, 1, 1))]) == []
    whole = wire.WorkerWiring(ME, 4, 0, edges([(6, 10)]))
    assert fired_by(worker, whole) == {6: 0, 8: 1, 10: 1}


# Credit -------------------------------------------------------------------------------


def test_a_chain_of_thousands_splits_its_credit_to_the_end() -> None:
    length = 5000
    worker = Worker(0, shares(length, 1))
    pairs = [(2 * cell, 2 * cell + 2) for cell in range(length - 1)]
    worker.receive([wire.WorkerWiring(0, 1, 0, edges(pairs))])
    (report,) = worker.receive([start(1, 0)])
    assert isinstance(report, wire.WorkerReport)
    assert fired_in(report) == {2 * cell: cell for cell in range(length)}
    assert (report.credit, report.pulses) == ((0,), length - 1)


@given(
    pairs=st.lists(
        st.tuples(st.integers(6, 11), st.integers(0, 2 * SENSORS - 1)),
        max_size=25,
        unique=True,
    ),
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
    said: list[wire.Message] = [
        start(1, *signal, credit=2),
        *([batch(*coming)] if coming else []),
    ]
    hops_found: dict[int, int] = {}
    leaving: list[tuple[int, int, int, int]] = []
    back, pulses = Fraction(0), 0
    for message in wired(*pairs).receive(said):
        if isinstance(message, wire.PulseBatch):
            leaving += pulses_in(message)
        elif isinstance(message, wire.WorkerReport):
            hops_found |= fired_in(message)
            back += sum(map(share, message.credit))
            pulses += message.pulses
    # Relaxing every edge as often as there are literals gives the shortest ways.
    hops = dict.fromkeys(signal, 0)
    for _, target, far, _ in sorted(coming, key=lambda pulse: -pulse[2]):
        hops[target] = min(far, hops.get(target, far))
    for _ in range(2 * SENSORS):
        for a, b in pairs:
            if a in hops and 6 <= b <= 11:
                hops[b] = min(hops.get(b, hops[a] + 1), hops[a] + 1)
    assert hops_found == hops
    assert pulses == sum(a in hops for a, _ in pairs)
    outside = [(a, b, hops[a] + 1) for a, b in pairs if a in hops and not 6 <= b <= 11]
    assert sorted(pulse[:3] for pulse in leaving) == sorted(outside)
    came = len(signal) * share(2) + sum(share(credit) for *_, credit in coming)
    left = sum(share(credit) for *_, credit in leaving)
    if came <= 1:
        assert left + back == came
