"""The edges sent to cells, the reports valid under them, and waves that settle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import AnswerLostError, MessageError
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.wiring_and_waves import SentWiring, WaveControl
from tests.support.edges import edge_list
from tests.support.swarm_parts import Host, hosting, keys_of
from tests.support.wave_messages import packed

SENSORS = 4
CHAIN = {(0, 2), (2, 4), (5, 3), (3, 1)}


def rewire(control: WaveControl, wanted: set[tuple[int, int]]) -> None:
    control.rewire(edge_list(wanted))


def begin(
    control: WaveControl,
    kind: wire.WaveKind,
    tick: int = 0,
    signal: tuple[int, ...] = (),
) -> wire.WaveStart:
    """Start a wave that takes one message."""
    (start,) = control.start(kind, tick, signal)
    assert isinstance(start, wire.WaveStart)
    return start


def settled(wave: int, literal: int, *credit: int, epoch: int = 0) -> wire.CellReport:
    return wire.CellReport(wave, literal // 2, 0, (literal,), (0,), credit, 0, epoch)


# Waves --------------------------------------------------------------------------------


def test_cells_are_told_which_waves_they_can_forget() -> None:
    control = WaveControl(SENSORS)
    assert begin(control, "signal", 0, (0,)).settled_below == 1
    assert begin(control, "signal", 0, (0,)).settled_below == 1
    control.report(settled(2, 0, 0))
    assert begin(control, "signal", 0, (0,)).settled_below == 1
    control.report(settled(1, 0, 0))
    assert begin(control, "signal", 0, (0,)).settled_below == 3


# Who is told of a wave ----------------------------------------------------------------


def told_of(messages: list[wire.Message]) -> list[tuple[int, int]]:
    """Return the cell and the fence of each start."""
    return [(m.cell, m.fence) for m in messages if isinstance(m, wire.WaveStart)]


A_FEW, MANY = (0, 1, 9, 4), (0, 2, 4, 6, 8)


@pytest.mark.parametrize(
    ("workers", "signals", "expected"),
    [
        (0, [(0,)], [[(-1, 1)]]),  # the first goes to all
        (0, [MANY, A_FEW], [[(-1, 1)], [(0, 1), (2, 1), (4, 1)]]),
        (0, [(0,), MANY, (0,)], [[(-1, 1)], [(-1, 2)], [(0, 2)]]),
        (3, [(4,), (4,), A_FEW], [[(-1, 1)], [(-1, 2)], [(-1, 3)]]),
    ],
)
def test_a_wave_of_a_few_goes_to_their_cells_only(
    workers: int, signals: list[tuple[int, ...]], expected: list[list[tuple[int, int]]]
) -> None:
    control = WaveControl(8, workers=workers)
    starts = [control.start("signal", 1, signal) for signal in signals]
    assert [told_of(each) for each in starts] == expected
    for start in (one for each in starts for one in each):
        assert isinstance(start, wire.WaveStart)
        own = f"wavestart/{start.cell}"
        assert start.key == ("wavestart" if start.cell < 0 else own)
    assert control.in_flight == tuple(range(1, len(signals) + 1))


def test_the_first_wave_after_a_wiring_is_announced_to_all() -> None:
    control = WaveControl(SENSORS)
    rewire(control, CHAIN)
    control.start("state", 1)
    assert told_of(control.start("signal", 1, (0,))) == [(0, 1)]
    rewire(control, set())
    assert told_of(control.start("signal", 1, (0,))) == [(-1, 3)]
    assert told_of(control.start("signal", 1, (0,))) == [(0, 3)]


def test_cells_hear_of_a_wave_now_and_then_so_that_they_can_forget() -> None:
    control = WaveControl(SENSORS)
    announced = []
    for number in range(1, 300):
        ((cell, _),) = told_of(control.start("signal", 0, (0,)))
        if cell < 0:
            announced.append(number)
        control.report(settled(number, 0, 0))
    assert len(announced) > 3
    assert max(np.diff(announced)) <= 70


# By which wiring a cell acted ---------------------------------------------------------


def test_a_report_by_a_lost_wiring_counts_for_nothing_and_a_repeat_mends_it() -> None:
    control = WaveControl(SENSORS)
    rewire(control, CHAIN)
    control.start("signal", 0, (5,))
    with pytest.raises(MessageError, match=r"of epoch 1, got epoch 0 from cell 2$"):
        control.report(settled(1, 5, 0))
    assert control.in_flight == (1,)
    control.repeat(1, ())
    wave = control.report(settled(2, 5, 0, epoch=2))
    assert wave is not None
    assert np.flatnonzero(wave.reached).tolist() == [5]


# Repeats ------------------------------------------------------------------------------


def test_a_repeat_goes_out_after_whole_wirings_under_a_new_number() -> None:
    control = WaveControl(SENSORS)
    rewire(control, CHAIN)
    control.start("signal", 4, (0, 5))
    assert control.repeat(1, ()) == [
        wire.Wiring(0, 2, 0, add=(2,)),
        wire.Wiring(1, 2, 0, add=(4,), add_complement=(1,)),
        wire.Wiring(2, 2, 0, add_complement=(3,)),
        wire.WaveStart(2, 4, "signal", 1, 2, (0, 5), 1, 2),
    ]
    assert control.in_flight == (2,)


READ = (0, 3, 4, 7)


@pytest.mark.parametrize(
    ("kind", "signal", "seeds", "observed", "again"),
    [
        ("state", (), 4, READ, wire.WaveStart(3, 7, "state", 2, 1, READ, 2, 3)),
        ("state", (), 1, (), wire.WaveStart(3, 7, "state", 0, 1, (), 2, 3)),
        ("signal", (6,), 0, READ, wire.WaveStart(3, 7, "signal", 0, 1, (6,), 2, 3)),
    ],
)
def test_what_is_repeated_keeps_its_signal_and_what_is_given_up_counts_no_more(
    kind: wire.WaveKind,
    signal: tuple[int, ...],
    seeds: int,
    observed: tuple[int, ...],
    again: wire.WaveStart,
) -> None:
    control = WaveControl(SENSORS)
    control.start("signal", 7, (0,))  # as long as it is not settled, none below is
    control.start(kind, 7, signal, seeds=seeds)
    assert control.repeat(2, observed) == [again]
    assert control.in_flight == (1, 3)
    assert control.report(settled(2, 6, 0)) is None
    assert control.report(settled(1, 0, 0)) is not None
    assert control.report(settled(1, 0, 0)) is None
    assert list(control.in_flight) == [3]


def test_a_wave_sent_often_enough_is_lost_and_the_error_says_where() -> None:
    control = WaveControl(SENSORS, repeats=2)
    rewire(control, CHAIN)
    control.start("state", 9)
    observed = (0, 2, 5, 7)
    control.repeat(1, observed)
    control.repeat(2, observed)
    control.report(settled(3, 0, 4, epoch=1))
    expected = (
        r"^wave 3 \(tick 9\): must settle within its deadline, got 3 tries;"
        r" missing credit 0\.9375, silent: cell/1, cell/2, cell/3$"
    )
    with pytest.raises(AnswerLostError, match=expected):
        control.repeat(3, observed)


# Workers ------------------------------------------------------------------------------


def test_a_lost_wave_names_the_workers_that_owe_a_report() -> None:
    control = WaveControl(7, repeats=0, workers=3)
    rewire(control, {(0, 2), (2, 4), (4, 6), (3, 1), (5, 3), (7, 5), (0, 8), (0, 13)})
    control.start("signal", 0, (0,))
    fired = packed(0, 2), packed(0, 1)
    control.report(wire.WorkerReport(1, 0, 0, *fired, (1,), 0, epoch=1))
    expected = (
        r"^wave 1 \(tick 0\): must settle within its deadline, got 1 tries; missing"
        r" credit 0\.5, silent: worker/0, worker/1, worker/2$"
    )
    with pytest.raises(AnswerLostError, match=expected):
        control.repeat(1, ())


CELLS, WORKERS = 7, 3
Pairs = set[tuple[int, int]]
literals = st.integers(0, 2 * CELLS - 1)
wirings = st.sets(st.tuples(literals, literals), max_size=20)


def known(host: Host) -> Pairs:
    """Return the edges that a cell or a worker has."""
    if isinstance(host, Cell):
        return {(a, b) for a, targets in host._targets.items() for b in targets}
    net = host._edges.net
    return {
        (net.first + place, target)
        for place, start in enumerate(net.starts[:-1].tolist())
        for target in net.targets[start : net.starts[place + 1]].tolist()
    }


@pytest.mark.parametrize("workers", [0, WORKERS])
@given(
    plan=st.lists(wirings | st.sampled_from(["whole", "forget"]), max_size=8),
    frame=st.integers(1, 5),
)
def test_its_messages_give_the_parts_the_edges(
    workers: int, plan: list[Pairs | str], frame: int
) -> None:
    wiring = SentWiring(CELLS, workers, frame)
    hosts = list(hosting(CELLS, workers).values())
    wanted: Pairs = set()
    for step in plan:
        if step == "forget":
            wiring.is_forgotten = True
            messages = wiring.rewire(edge_list(wanted))
            hosts = list(hosting(CELLS, workers).values())  # new, as after a death
        elif isinstance(step, str):
            messages = wiring.rewire_whole()
        else:
            messages = wiring.rewire(edge_list(step))
            wanted = step
        for message in messages:
            if isinstance(message, wire.WorkerWiring):
                assert max(len(message.add), len(message.drop)) <= 8 * frame
            (host,) = (each for each in hosts if message.key in keys_of(each))
            assert host.receive([message]) == []
        assert {edge for host in hosts for edge in known(host)} == wanted
        for literal in range(2 * CELLS):
            targets = sorted(b for a, b in wanted if a == literal)
            assert wiring.targets(literal) == targets


def cell_wirings(*steps: Pairs | None) -> list[wire.Message]:
    """Return what cells are told last of several wirings; None is a whole one."""
    return _last(SentWiring(CELLS), steps)


def worker_wirings(*steps: Pairs | None, workers: int = WORKERS) -> list[wire.Message]:
    """Return what workers are told last of several wirings, two edges in a frame."""
    return _last(SentWiring(CELLS, workers, frame=2), steps)


def _last(wiring: SentWiring, steps: tuple[Pairs | None, ...]) -> list[wire.Message]:
    messages: list[wire.Message] = []
    for step in steps:
        if step is None:
            messages = wiring.rewire_whole()
        else:
            messages = wiring.rewire(edge_list(step))
    return messages


FEW = {(0, 2), (6, 8)}


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (cell_wirings(None), []),
        (cell_wirings(set()), []),
        (cell_wirings(CHAIN, CHAIN), []),
        (
            cell_wirings(CHAIN, CHAIN | {(4, 6), (7, 5)}),
            [
                wire.Wiring(2, 2, 1, add=(6,)),
                wire.Wiring(3, 2, 0, add_complement=(5,)),
            ],
        ),
        (
            cell_wirings(CHAIN | {(4, 6), (7, 5)}, CHAIN),
            [
                wire.Wiring(2, 2, 1, drop=(6,)),
                wire.Wiring(3, 2, 1, drop_complement=(5,)),
            ],
        ),
        (
            cell_wirings(CHAIN, {(0, 2)}, None),
            [
                wire.Wiring(0, 3, 0, add=(2,)),
                wire.Wiring(1, 3, 0),
                wire.Wiring(2, 3, 0),
            ],
        ),
        (worker_wirings(None), []),
        (worker_wirings(FEW, FEW), []),
        (
            worker_wirings(FEW, {(0, 2), (6, 4), (7, 1)}),
            [wire.WorkerWiring(1, 2, 1, packed(6, 4, 7, 1), packed(6, 8))],
        ),
        (
            worker_wirings(FEW, {(0, 2)}, None),
            [wire.WorkerWiring(0, 2, 0, packed(0, 2)), wire.WorkerWiring(1, 3, 0)],
        ),
        (
            worker_wirings({(0, 2), (2, 4), (4, 6)}, None, {(0, 4)}, workers=1),
            [
                wire.WorkerWiring(0, 5, 4, packed(0, 4), packed(0, 2, 2, 4)),
                wire.WorkerWiring(0, 6, 5, b"", packed(4, 6)),
            ],
        ),
    ],
)
def test_only_parts_whose_edges_changed_are_told_or_all_that_were(
    told: list[wire.Message], expected: list[wire.Message]
) -> None:
    assert told == expected


def report(
    by_worker: bool, part: int, epoch: int
) -> wire.CellReport | wire.WorkerReport:
    if by_worker:
        return wire.WorkerReport(1, part, 0, b"", b"", (1,), 0, epoch)
    return wire.CellReport(1, part, 0, (), (), (1,), 0, epoch)


def in_force(wiring: SentWiring) -> list[list[int]]:
    """Return the epochs by which each of the first three parts may report."""
    return [
        [epoch for epoch in range(20) if _allows(wiring, part, epoch)]
        for part in range(3)
    ]


def _allows(wiring: SentWiring, part: int, epoch: int) -> bool:
    try:
        wiring.check_epoch(report(wiring.workers > 0, part, epoch))
    except MessageError as error:
        return f"got epoch {epoch} from" not in str(error)
    return True


def test_a_worker_reports_by_all_frames_of_a_wiring_or_is_refused() -> None:
    wiring = SentWiring(CELLS, WORKERS, frame=2)
    assert in_force(wiring) == [[0], [0], [0]]
    wiring.rewire(edge_list({(0, 2), (2, 4), (4, 6), (6, 8)}))
    assert in_force(wiring) == [[2], [1], [0]]
    wiring.rewire_whole()  # the worker's frames are 3 and 4, and it may have neither
    assert in_force(wiring) == [[2, 4], [1, 2], [0]]
    wiring.rewire(edge_list({(0, 2), (2, 4), (4, 6), (6, 10)}))
    assert in_force(wiring) == [[2, 4], [3], [0]]
    wiring.rewire(edge_list({(0, 4), (6, 10)}))
    assert in_force(wiring) == [[6], [3], [0]]


def test_a_cell_reports_by_the_edges_in_force_or_is_refused() -> None:
    wiring = SentWiring(CELLS)
    wiring.rewire(edge_list(CHAIN))
    assert in_force(wiring) == [[1], [1], [1]]
    wiring.rewire(edge_list(CHAIN | {(0, 6)}))
    assert in_force(wiring) == [[2], [1], [1]]
    wiring.rewire_whole()  # changes the edges of no cell that had them
    assert in_force(wiring) == [[2, 3], [1, 3], [1, 3]]
    wiring.rewire(edge_list(set()))
    assert in_force(wiring) == [[4], [4], [4]]


@pytest.mark.parametrize(
    ("workers", "by_worker", "part", "what"),
    [
        (0, True, 0, "workerreport: must be a cell's, got worker 0"),
        (0, False, CELLS, "cellreport: must be a cell's, got cell 7"),
        (WORKERS, False, 0, "cellreport: must be a worker's, got cell 0"),
        (WORKERS, True, 3, "workerreport: must be a worker's, got worker 3"),
    ],
)
def test_a_report_of_a_part_that_is_not_there_is_refused(
    workers: int, by_worker: bool, part: int, what: str
) -> None:
    with pytest.raises(MessageError, match=f"^{what}$"):
        SentWiring(CELLS, workers).cells_of(report(by_worker, part, 0))
