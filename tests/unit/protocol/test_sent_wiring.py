"""What the conductor tells workers, and what it takes from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import AnswerLostError, MessageError
from neurosnap.poc.order.literals import Words, to_words
from neurosnap.protocol.partition import shares
from neurosnap.protocol.sent_wiring import WorkerWires
from neurosnap.protocol.wave_control import WaveControl
from neurosnap.protocol.worker import Worker
from tests.support.edges import edge_matrix
from tests.support.wave_messages import packed

SENSORS, WORKERS = 7, 3
LITERALS = 2 * SENSORS
CHAIN = [(0, 2), (2, 4), (4, 6), (3, 1), (5, 3), (7, 5)]

literals = st.integers(0, LITERALS - 1)
wirings = st.sets(st.tuples(literals, literals), max_size=20)


def edges(pairs: set[tuple[int, int]] | list[tuple[int, int]]) -> Words:
    return to_words(edge_matrix(LITERALS, pairs))


def joined(pairs: set[tuple[int, int]]) -> NDArray[np.int64]:
    return np.array(sorted(a << 32 | b for a, b in pairs), np.int64)


def tally(
    wave: int,
    worker: int,
    fired: dict[int, int],
    *credit: int,
    part: int = 0,
    epoch: int = 0,
) -> wire.WorkerReport:
    hops = packed(*fired.values())
    return wire.WorkerReport(wave, worker, part, packed(*fired), hops, credit, 0, epoch)


def known(workers: list[Worker]) -> set[tuple[int, int]]:
    """Return the edges the workers have: each literal fires alone, and who follows."""
    found = set()
    for worker in workers:
        net = worker._edges.net
        for place, start in enumerate(net.starts[:-1]):
            targets = net.targets[start : net.starts[place + 1]].tolist()
            found |= {(net.first + place, target) for target in targets}
    return found


# Wiring -------------------------------------------------------------------------------


@given(st.lists(wirings | st.just("whole"), max_size=8), st.integers(1, 5))
def test_its_frames_give_the_workers_the_edges(
    plan: list[set[tuple[int, int]] | str], frame: int
) -> None:
    wires = WorkerWires(SENSORS, WORKERS, frame)
    workers = [Worker(number, shares(SENSORS, WORKERS)) for number in range(WORKERS)]
    wanted: set[tuple[int, int]] = set()
    for step in plan:
        if isinstance(step, str):
            messages = wires.rewire_whole()
        else:
            messages = wires.rewire_to(joined(step))
            wanted = step
        for message in messages:
            assert isinstance(message, wire.WorkerWiring)
            assert max(len(message.add), len(message.drop)) <= 8 * frame
            assert workers[message.worker].receive([message]) == []
        assert known(workers) == wanted
        for literal in range(LITERALS):
            targets = sorted(b for a, b in wanted if a == literal)
            assert list(wires.targets(literal)) == targets


@given(wirings, wirings)
def test_a_matrix_and_a_list_of_edges_say_the_same(
    first: set[tuple[int, int]], second: set[tuple[int, int]]
) -> None:
    by_matrix, by_list = (
        WaveControl(SENSORS, workers=2),
        WaveControl(SENSORS, workers=2),
    )
    for pairs in (first, second):
        assert by_matrix.rewire(edges(pairs)) == by_list.rewire_to(joined(pairs))
    assert by_matrix.rewire_whole() == by_list.rewire_whole()


@given(wirings, wirings)
def test_cells_are_told_the_same_by_a_list_of_edges(
    first: set[tuple[int, int]], second: set[tuple[int, int]]
) -> None:
    by_matrix, by_list = WaveControl(SENSORS), WaveControl(SENSORS)
    for pairs in (first, second):
        assert by_matrix.rewire(edges(pairs)) == by_list.rewire_to(joined(pairs))


def test_only_workers_whose_edges_changed_are_told() -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    control.rewire(edges([(0, 2), (6, 8)]))
    assert control.rewire(edges([(0, 2), (6, 4), (7, 1)])) == [
        wire.WorkerWiring(1, 2, 1, packed(6, 4, 7, 1), packed(6, 8))
    ]
    assert control.rewire(edges([(0, 2), (6, 4), (7, 1)])) == []


def test_a_whole_wiring_goes_to_every_worker_that_has_or_had_edges() -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    assert control.rewire_whole() == []
    control.rewire(edges([(0, 2), (6, 8)]))
    control.rewire(edges([(0, 2)]))
    assert control.rewire_whole() == [
        wire.WorkerWiring(0, 2, 0, packed(0, 2)),
        wire.WorkerWiring(1, 3, 0),
    ]


def test_what_is_too_much_for_a_frame_goes_on_in_the_next() -> None:
    wires = WorkerWires(SENSORS, 1, frame=2)
    assert wires.rewire_to(joined({(0, 2), (2, 4), (4, 6)})) == [
        wire.WorkerWiring(0, 1, 0, packed(0, 2, 2, 4)),
        wire.WorkerWiring(0, 2, 1, packed(4, 6)),
    ]
    assert wires.rewire_whole() == [
        wire.WorkerWiring(0, 3, 0, packed(0, 2, 2, 4)),
        wire.WorkerWiring(0, 4, 3, packed(4, 6)),
    ]
    assert wires.rewire_to(joined({(0, 4)})) == [
        wire.WorkerWiring(0, 5, 4, packed(0, 4), packed(0, 2, 2, 4)),
        wire.WorkerWiring(0, 6, 5, b"", packed(4, 6)),
    ]


# Waves --------------------------------------------------------------------------------


def test_every_wave_is_announced_to_all() -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    control.rewire(edges(CHAIN))
    for number in (1, 2, 3):
        (start,) = control.start("signal", 0, (4,))
        assert isinstance(start, wire.WaveStart)
        assert (start.key, start.wave, start.fence) == ("wavestart", number, number)


def test_a_wave_settles_by_the_reports_of_workers() -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    control.start("signal", 0, (0, 6))
    assert control.report(tally(1, 0, {0: 0, 3: 5}, 2)) is None
    assert control.report(tally(1, 0, {0: 0, 3: 5}, 2)) is None  # once more
    assert control.report(tally(1, 1, {6: 0}, 1)) is None
    wave = control.report(tally(1, 0, {}, 2, part=1))
    assert wave is not None
    assert wave.hops == {0: 0, 3: 5, 6: 0}
    assert control.in_flight == ()


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (
            wire.CellReport(1, 0, 0, (0,), (0,), (1,), 0),
            "cellreport: must be a worker's, got",
        ),
        (tally(1, 3, {0: 0}, 1), "workerreport: must be a worker's, got worker 3"),
        (
            tally(1, 0, {6: 0}, 1),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            tally(1, 1, {4: 0}, 1),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            tally(1, 0, {-1: 0}, 1),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            tally(1, 0, {0: -1}, 1),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            wire.WorkerReport(1, 0, 0, packed(0, 0), packed(0, 0), (1,), 0),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            wire.WorkerReport(1, 0, 0, packed(0, 2), packed(0), (1,), 0),
            "workerreport: must report on wave 1, own literals, each",
        ),
        (
            wire.WorkerReport(1, 0, 0, b"\0\0", packed(0), (1,), 0),
            "workerreport: literals: must be four bytes a number, got 2",
        ),
        (
            wire.WorkerReport(1, 0, 0, packed(0), b"\0", (1,), 0),
            "workerreport: hops: must be four bytes a number, got 1",
        ),
        (tally(1, 0, {0: 0}), "workerreport: must give back credit"),
        (
            tally(1, 0, {0: 0}, 0, 0),
            "workerreport: must give back at most the credit given",
        ),
        (
            tally(1, 0, {0: 2**20}, 1),
            "workerreport: must give back credit, and hold numbers",
        ),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_a_report_that_cannot_be_right_is_refused(
    wrong: wire.CellReport | wire.WorkerReport, what: str
) -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    control.start("signal", 0, (0, 6))
    with pytest.raises(MessageError) as caught:
        control.report(wrong)
    assert str(caught.value).startswith(what)
    assert control.report(tally(1, 0, {0: 0}, 1)) is None
    assert control.report(tally(1, 1, {6: 0}, 1)) is not None


def test_cells_take_no_report_of_a_worker() -> None:
    control = WaveControl(SENSORS)
    control.start("signal", 0, (0,))
    expected = "^workerreport: must be a cell's, got worker 0$"
    with pytest.raises(MessageError, match=expected):
        control.report(tally(1, 0, {0: 0}, 0))


def test_a_lost_wave_names_the_workers_that_owe_a_report() -> None:
    control = WaveControl(SENSORS, repeats=0, workers=WORKERS)
    control.rewire(edges([*CHAIN, (0, 8), (0, 13)]))
    control.start("signal", 0, (0,))
    control.report(tally(1, 0, {0: 0, 2: 1}, 1, epoch=1))
    expected = (
        r"^wave 1 \(tick 0\): must settle within its deadline, got 1 tries; missing"
        r" credit 0\.5, silent cells: 1 of worker/0, 1 of worker/1, 1 of worker/2$"
    )
    with pytest.raises(AnswerLostError, match=expected):
        control.repeat(1, ())


def test_a_repeat_wires_every_worker_anew_first() -> None:
    control = WaveControl(SENSORS, workers=WORKERS)
    control.rewire(edges(CHAIN))
    control.start("signal", 0, (0,))
    *wirings_, start = control.repeat(1, ())
    assert all(isinstance(m, wire.WorkerWiring) and m.after == 0 for m in wirings_)
    assert len(wirings_) == 2
    assert isinstance(start, wire.WaveStart)
    assert (start.wave, start.repeats) == (2, 1)


def allows(wires: WorkerWires, worker: int, epoch: int) -> bool:
    """Tell whether a worker may report by an epoch."""
    try:
        report = tally(1, worker, {}, 1, epoch=epoch)
        wires.check_epoch(report, wires.cells_of(report))
    except MessageError as error:
        return not str(error).endswith(f"got epoch {epoch} from worker {worker}")
    return True


def in_force(wires: WorkerWires) -> list[list[int]]:
    """Return the epochs by which each worker may report."""
    return [
        [epoch for epoch in range(20) if allows(wires, worker, epoch)]
        for worker in range(WORKERS)
    ]


def test_a_worker_reports_by_all_frames_of_a_wiring_or_is_refused() -> None:
    wires = WorkerWires(SENSORS, WORKERS, frame=2)
    assert in_force(wires) == [[0], [0], [0]]
    wires.rewire_to(joined({(0, 2), (2, 4), (4, 6), (6, 8)}))
    assert in_force(wires) == [[2], [1], [0]]
    wires.rewire_whole()  # the worker's frames are 3 and 4, and it may have neither
    assert in_force(wires) == [[2, 4], [1, 2], [0]]
    wires.rewire_to(joined({(0, 2), (2, 4), (4, 6), (6, 10)}))
    assert in_force(wires) == [[2, 4], [3], [0]]
    wires.rewire_to(joined({(0, 4), (6, 10)}))
    assert in_force(wires) == [[6], [3], [0]]
