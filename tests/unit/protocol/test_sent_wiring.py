"""The edges sent to cells and workers, and the reports that are valid under them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.wiring_and_waves import SentWiring
from tests.support.edges import edge_list
from tests.support.swarm_parts import Host, hosting, keys_of
from tests.support.wave_messages import packed

SENSORS, WORKERS = 7, 3
Pairs = set[tuple[int, int]]

literals = st.integers(0, 2 * SENSORS - 1)
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
    wiring = SentWiring(SENSORS, workers, frame)
    hosts = list(hosting(SENSORS, workers).values())
    wanted: Pairs = set()
    for step in plan:
        if step == "forget":
            wiring.is_forgotten = True
            messages = wiring.rewire(edge_list(wanted))
            hosts = list(hosting(SENSORS, workers).values())  # new, as after a death
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
        for literal in range(2 * SENSORS):
            targets = sorted(b for a, b in wanted if a == literal)
            assert wiring.targets(literal) == targets


def cell_wirings(*steps: Pairs | None) -> list[wire.Message]:
    """Return what cells are told last of several wirings; None is a whole one."""
    return _last(SentWiring(SENSORS), steps)


def worker_wirings(*steps: Pairs | None, workers: int = WORKERS) -> list[wire.Message]:
    """Return what workers are told last of several wirings, two edges in a frame."""
    return _last(SentWiring(SENSORS, workers, frame=2), steps)


def _last(wiring: SentWiring, steps: tuple[Pairs | None, ...]) -> list[wire.Message]:
    messages: list[wire.Message] = []
    for step in steps:
        if step is None:
            messages = wiring.rewire_whole()
        else:
            messages = wiring.rewire(edge_list(step))
    return messages


CHAIN = {(0, 2), (2, 4), (5, 3), (3, 1)}
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
    wiring = SentWiring(SENSORS, WORKERS, frame=2)
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
    wiring = SentWiring(SENSORS)
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
        (0, False, SENSORS, "cellreport: must be a cell's, got cell 7"),
        (WORKERS, False, 0, "cellreport: must be a worker's, got cell 0"),
        (WORKERS, True, 3, "workerreport: must be a worker's, got worker 3"),
    ],
)
def test_a_report_of_a_part_that_is_not_there_is_refused(
    workers: int, by_worker: bool, part: int, what: str
) -> None:
    with pytest.raises(MessageError, match=f"^{what}$"):
        SentWiring(SENSORS, workers).cells_of(report(by_worker, part, 0))
