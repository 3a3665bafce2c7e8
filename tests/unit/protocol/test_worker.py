"""One worker, message by message."""

from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from tests.support.wave_messages import packed, share, start, state_wave
from tests.support.worker_messages import (
    ME,
    SENSORS,
    batch,
    edges,
    fired_in,
    observation,
    pulses_in,
    wired,
)


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
