"""One worker, message by message, and what it refuses."""

from collections.abc import Iterable, Sequence
from fractions import Fraction

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.cell_and_worker_base import DEEPEST
from neurosnap.protocol.wave_settling import fired
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from neurosnap.sensorium import pack
from tests.support.wave_messages import packed, share, start, state_wave

# The second of three workers over nine sensors; its literals are 6 to 11.
SENSORS, WORKERS, ME = 9, 3, 1
HOSTED = shares(SENSORS, WORKERS)
Edges = Iterable[tuple[int, int]]


def edges(pairs: Edges) -> bytes:
    return packed(*(literal for pair in sorted(pairs) for literal in pair))


def wired(*pairs: tuple[int, int]) -> Worker:
    """Return the worker under test with out-edges."""
    worker = Worker(ME, HOSTED)
    assert worker.receive([wire.WorkerWiring(ME, 1, 0, edges(pairs))]) == []
    return worker


def batch(
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


def fired_in(report: wire.WorkerReport) -> dict[int, int]:
    return dict(zip(*fired(report), strict=True))


def fired_by(worker: Worker, *messages: wire.Message) -> dict[int, int]:
    """Return what fires by messages for which a worker sends one report alone."""
    (report,) = worker.receive(messages)
    assert isinstance(report, wire.WorkerReport)
    return fired_in(report)


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


def changed(
    epoch: int, after: int, *add: tuple[int, int], drop: Sequence[tuple[int, int]] = ()
) -> wire.Message:
    return wire.WorkerWiring(ME, epoch, after, edges(add), edges(drop))


EARLY = batch((0, 6, 1, 1))


@pytest.mark.parametrize(
    ("batches", "expected"),
    [
        # It fires once a wave, and its reports are numbered.
        (
            [[start(1, 6)], [batch((0, 6, 4, 5))], [start(2, 6)]],
            ["1.0 by 1: 6@0 8@1", "1.1 by 1:", "2.0 by 1: 6@0 8@1"],
        ),
        # A signal that asks others leaves it silent.
        ([[start(1, 0, 5, 12)]], []),
        # Pulses wait for their wave, each once.
        ([[EARLY], [EARLY], [start()]], ["1.0 by 1: 6@1 8@2"]),
        # A state wave waits for its reading, and pulses with it.
        (
            [[state_wave(1, 1, credit=4), EARLY], [observation(1, 4)]],
            ["1.0 by 1: 7@0 8@0 11@0 6@1"],
        ),
        # A repeated one says what was observed.
        ([[state_wave(2, 1, 1, 7, 8, 11, 12)]], ["2.0 by 1: 7@0 8@0 11@0"]),
        # Readings are kept by tick, the first of each.
        (
            [
                [observation(1, 3), observation(2, 4), observation(1, 5)],
                [state_wave(1, 1, credit=4), state_wave(2, 2, credit=4)],
            ],
            ["1.0 by 1: 6@0 9@0 11@0 8@1", "2.0 by 1: 7@0 8@0 11@0"],
        ),
        # With unknown readings alone it only passes pulses on.
        (
            [
                [wire.Observation(1, b"\x01\x00", known=b"\x01\x00")],
                [state_wave(1, 1, credit=4)],
                [EARLY],
            ],
            ["1.0 by 1: 6@1 8@2"],
        ),
        # What has settled is forgotten.
        (
            [[start(1, 6), start(2, 8, below=2)], [EARLY, start(1, 6)]],
            ["2.0 by 1: 8@0"],
        ),
        # It says by which frame it acted, and what comes after does not count.
        (
            [[start(1, 6), changed(2, 1, (6, 10), drop=[(6, 8)]), start(2, 6)]],
            ["1.0 by 1: 6@0 8@1", "2.0 by 2: 6@0 10@1"],
        ),
        # A whole wiring forgets the one before; an edge may be told twice.
        (
            [[changed(5, 0, (6, 10))], [changed(6, 5, (6, 10))], [start(1, 6)]],
            ["1.0 by 6: 6@0 10@1"],
        ),
        # After a lost frame it is silent until it is wired whole.
        (
            [
                [changed(3, 2, (6, 10))],
                [start(1, 6), batch((0, 8, 1, 1))],
                [changed(4, 0, (6, 10))],
            ],
            [
                "workerwiring: must build on epoch 1, got 2",
                "1.0 by 4: 6@0 10@1 8@1",
            ],
        ),
        # What came before changes nothing.
        (
            [[changed(2, 1, (10, 9)), observation(1, 3), state_wave(1, 1), EARLY]] * 2,
            ["1.0 by 2: 6@0 9@0 11@0 8@1"],
        ),
    ],
)
def test_what_it_says_of_what_it_receives(
    batches: list[list[wire.Message]], expected: list[str]
) -> None:
    worker = wired((6, 8))
    said = [shown(one) for each in batches for one in worker.receive(each)]
    assert said == expected


def shown(message: wire.Message) -> str:
    if isinstance(message, wire.Fault):
        return message.what
    assert isinstance(message, wire.WorkerReport)
    fired = "".join(f" {literal}@{hop}" for literal, hop in fired_in(message).items())
    return f"{message.wave}.{message.part} by {message.epoch}:{fired}"


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


@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.just(n), st.integers(1, n))))
def test_every_cell_has_one_worker_and_no_worker_has_much_more(
    sizes: tuple[int, int],
) -> None:
    cells, workers = sizes
    hosted = shares(cells, workers)
    assert len(hosted) == workers
    assert [cell for share in hosted for cell in share] == list(range(cells))
    counts = [len(share) for share in hosted]
    assert max(counts) - min(counts) <= 1
    assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("workers", [-1, 0, 4])
def test_a_worker_without_a_cell_is_refused(workers: int) -> None:
    expected = rf"^workers: must be at least 1 and at most the cells, 3, got {workers}$"
    with pytest.raises(InvalidValueError, match=expected):
        shares(3, workers)


# What is refused ----------------------------------------------------------------------


def batch_with(**fields: object) -> wire.PulseBatch:
    return msgspec.structs.replace(batch((0, 6, 1, 1)), **fields)


WRONG: list[tuple[wire.Message, str]] = [
    (wire.Pulse(1, 0, 6, 1, 0), "pulse: is not for a worker"),
    (wire.WorkerWiring(0, 2, 1), "workerwiring: must be for this worker, got 0"),
    (wire.WorkerWiring(ME, 4098, 0), "workerwiring: epoch must be at most 4096 bey"),
    (wire.WorkerWiring(ME, 2, 1, packed(6)), "workerwiring: add: must be eight byt"),
    (wire.WorkerWiring(ME, 2, 1, b"", packed(4, 6)), "workerwiring: drop must lead f"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, 18)), "workerwiring: add must lead to 0 to"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, -1)), "workerwiring: add must lead to 0"),
    (wire.WorkerWiring(ME, 2, 1, packed(6, 8, 6, 8)), "workerwiring: add must be asc"),
    (wire.WaveStart(2, 0, "signal", 0, 1, (6,), cell=3), "wavestart: must be for all"),
    (start(2, 6, credit=DEEPEST + 1), "wavestart: must have credit up to"),
    (start(2, 6, below=3), "wavestart: must settle only what is before wave 2, got"),
    (start(10_000, 6), "wavestart: wave must be at most 4096 beyond 1, got 10000"),
    (state_wave(2, 50, credit=4), "wavestart: tick must be at most 8 ticks after 1"),
    (observation(50), "observation: tick must be at most 8 ticks after 1, got 50"),
    (wire.Observation(2, b"\0"), "observation: must hold 2 bytes, got 1"),
    (wire.Observation(2, b"\1\0", known=b"\2\0"), "observation: must be 0 where it"),
    (batch_with(to=2), "pulsebatch: must be for this worker, got 2"),
    (batch((6, 6, 1, 1), worker=1), "pulsebatch: must be another worker's, got 1"),
    (batch((0, 6, 1, 1), worker=3), "pulsebatch: must be another worker's, got 3"),
    (batch((12, 6, 1, 1)), "pulsebatch: sources must be 0 to 5, got 12 to 12"),
    (batch((0, 6, 1, 1), (0, 12, 1, 1)), "pulsebatch: targets must be 6 to 11, got"),
    (batch((0, 6, 0, 1)), "pulsebatch: hops must be 1 to"),
    (batch((0, 6, DEEPEST + 1, 1)), "pulsebatch: hops must be 1 to"),
    (batch((0, 6, 1, -1)), "pulsebatch: credit must be 0 to"),
    (batch((0, 6, 1, DEEPEST + 1)), "pulsebatch: credit must be 0 to"),
    (batch((0, 6, 1, 1), wave=10_000), "pulsebatch: wave must be at most 4096 beyond"),
    (batch_with(hops=packed(1, 1)), "pulsebatch: must be whole pulses, got [1, 2]"),
    (wire.PulseBatch(1, 0, ME, 0, b"", b"", b"", b""), "pulsebatch: must be whole pul"),
    (batch_with(hops=b"\1"), "pulsebatch: hops: must be four bytes a number, got 1"),
]


@pytest.mark.parametrize(("message", "what"), WRONG, ids=[what for _, what in WRONG])
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    message: wire.Message, what: str
) -> None:
    workers = [wired((6, 8), (8, 0)), wired((6, 8), (8, 0))]
    before: list[wire.Message] = [observation(1, 3), state_wave(1, 1, credit=4)]
    after: list[wire.Message] = [
        batch((0, 10, 1, 1)),
        start(2, 6),
        observation(2),
        state_wave(3, 2, credit=4),
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
    held = batch((0, 6, 1, 1), (0, 8, 1, 1))
    assert worker.receive([held]) == []
    more = batch((0, 6, 1, 1), (0, 8, 1, 1), wave=2)
    (fault,) = worker.receive([more])
    assert fault == wire.Fault(
        "worker/1", "pulsebatch: must leave up to 3 pulses waiting"
    )
    assert fired_by(worker, start())
    # Those wait no more, and those of a wave that is forgotten do not either.
    assert worker.receive([more]) == []
    assert fired_by(worker, start(3, 6, below=3))
    assert worker.receive([batch((0, 6, 1, 1), (0, 8, 1, 1), wave=4)]) == []


def test_more_batches_than_are_remembered_are_refused_until_waves_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.cell_and_worker_base.REMEMBERED", 2)
    worker = wired()
    worker.receive([start(1, 6)])
    for part in (0, 1):
        worker.receive([batch((0, 8, 1, 1), part=part)])
    said = worker.receive([batch((0, 8, 1, 1), part=2)])
    what = "pulsebatch: must be one of 2 in flight, got one more"
    assert said == [wire.Fault("worker/1", what)]
    worker.receive([start(2, 6, below=2)])
    assert fired_by(worker, batch((0, 8, 1, 1), wave=2))


def test_more_waves_than_may_be_in_flight_are_refused_until_some_settle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("neurosnap.protocol.cell_and_worker_base.WAVES", 3)
    worker = wired()
    waiting = [batch((0, 8, 1, 1), wave=wave) for wave in (2, 3, 4, 5)]
    (fault,) = worker.receive(waiting)
    what = "pulsebatch: must be of 3 waves in all, got wave 5 too"
    assert fault == wire.Fault("worker/1", what)
    (fault,) = worker.receive([start(1, 6)])
    what = "wavestart: must be of 3 waves in all, got wave 1 too"
    assert fault == wire.Fault("worker/1", what)
    # What a wave settles makes room for it.
    assert fired_by(worker, start(5, 6, below=3))
    assert set(worker._waves) == {3, 4, 5}


def test_of_a_signal_only_its_own_literals_are_kept_each_once() -> None:
    worker = wired()
    worker.receive([wire.WorkerWiring(ME, 3, 2)])  # a change was lost: the waves wait
    signal = tuple(range(2 * SENSORS)) * 1000
    worker.receive([start(1, *signal), state_wave(2, 1, *signal, credit=4)])
    kept = [wave.start for wave in worker._waves.values()]
    assert [one and one.signal for one in kept] == [tuple(range(6, 12))] * 2
    out = worker.receive([wire.WorkerWiring(ME, 4, 0)])
    found = [fired_in(m) for m in out if isinstance(m, wire.WorkerReport)]
    assert found == [dict.fromkeys(range(6, 12), 0)] * 2
