"""Learning in a worker: results, repeated answers, refusals and initial state."""

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot_bands import head_of
from neurosnap.protocol.key_frames import bands_of
from neurosnap.protocol.worker_learning import WorkerLearning

SHARES = [range(4), range(4, 6)]
ROWS = (0b000111, 0b001111, 0b000011, 0b011111, 0b000111)


def new(worker: int = 1) -> WorkerLearning:
    snapshot = EmpiricalSnapshot(6, 0.25, SHARES[worker])
    return WorkerLearning(worker, snapshot, band=4)


def whole(ticks: int, share: range | None = None) -> EmpiricalSnapshot:
    snapshot = EmpiricalSnapshot(6, 0.25, share)
    for bits in ROWS[:ticks]:
        snapshot.learn([bits >> k & 1 for k in range(6)])
    return snapshot


def bands(ticks: int, who: str = "it") -> list[wire.Band]:
    """Return the bands of both workers."""
    parts = (whole(ticks, share) for share in SHARES)
    return [band for part in parts for band in bands_of(part, ticks, 4, who)]


def learn(tick: int, **changes: object) -> wire.Learn:
    return wire.Learn(tick, bytes([ROWS[tick - 1]]), **changes)  # type: ignore[arg-type]


def test_what_is_learned_is_said_again_and_not_learned_again() -> None:
    worker = new()
    worker.learn(learn(1))
    first = worker.learn(learn(2))
    assert worker.learn(learn(2)) == first
    assert worker.tick == 2


def test_what_was_asked_is_from_before_it_was_learned() -> None:
    worker, before = new(), whole(3)
    for tick in (1, 2, 3):
        worker.learn(learn(tick))
    (piece,) = worker.learn(learn(4, sources=(8, 0, 3), targets=(0, 2, 11)))
    assert isinstance(piece, wire.Learned)
    asked = [(0, 8, 0), (2, 3, 11)]  # the second is another worker's
    for link, (place, a, b) in zip(piece.links, asked, strict=True):
        found = before.evidence(a, b)
        weights = found.both, found.against, found.since
        assert link == wire.WeighedLink(place, a, b, *weights)


def test_bands_go_before_the_answer_that_is_asked_for_them() -> None:
    worker = new()
    for tick in (1, 2, 3):
        worker.learn(learn(tick))
    *sent, answer = worker.learn(learn(3, frame=3))
    assert isinstance(answer, wire.Learned)
    assert answer.frame == 3
    assert sent == [band for band in bands(3, "worker/1") if band.offset >= 6]


def test_it_begins_with_the_bands_of_its_share_whatever_their_order() -> None:
    head = memoryview(head_of(whole(3)))
    size = len(head)
    sent = [
        wire.Band("it", 3, "snapshot", 0, head[:99]),
        wire.Band("it", 3, "snapshot", 99, head[99:]),
        *bands(3),
    ]
    worker, straight = new(), new()
    for tick in (1, 2, 3):
        straight.learn(learn(tick))
    for band in (*bands(2), *sent[:-1]):
        worker.receive_band(band)
    with pytest.raises(
        MessageError, match=r"must come after the bands .* lacks 12 byte"
    ):
        worker.learn(learn(4, begins=size))
    with pytest.raises(MessageError, match="lacks 1 byte"):
        worker.learn(learn(4, begins=size + 1))
    with pytest.raises(MessageError, match="must be of tick 1, got tick 4"):
        worker.learn(learn(4))
    for band in (*sent[::-1], *sent):
        worker.receive_band(band)
    first = straight.learn(learn(4))
    assert worker.learn(learn(4, begins=size)) == first
    assert worker.learn(learn(4, begins=size)) == first, "and does not begin again"
    assert [*worker.bands()] == [*straight.bands()]


@pytest.mark.parametrize(
    ("message", "rule"),
    [
        (learn(2), "learn: must be of tick 1, got tick 2"),
        (wire.Learn(1, b"\0\0"), "learn: packed bits: must be 1 bytes long"),
        (learn(1, known=b"\0"), "must hold a reading that is known"),
        (learn(1, sources=(1,)), "must have as many sources as targets, got 1 and 0"),
        (learn(1, sources=(1,), targets=(12,)), "must be of two of 6 sensors, got"),
        (learn(1, sources=(1,), targets=(0,)), "must be of two of 6 sensors, got"),
    ],
)
def test_what_cannot_be_right_is_refused(message: wire.Learn, rule: str) -> None:
    worker = new()
    with pytest.raises(MessageError, match=rule):
        worker.learn(message)
    assert worker.tick == 0
    assert worker.learn(learn(1)) == new().learn(learn(1))


def test_what_is_no_snapshot_to_begin_with_is_refused() -> None:
    worker, head = new(), memoryview(head_of(whole(3)))
    worker.receive_band(wire.Band("it", 3, "snapshot", 0, memoryview(b"x")))
    with pytest.raises(MessageError, match="learn: bands: must be a Snapshot"):
        worker.learn(learn(4, begins=1))
    for band in bands(3):
        wrong = memoryview(b"\xff" * len(band.data))
        worker.receive_band(msgspec.structs.replace(band, data=wrong))
    worker.receive_band(wire.Band("it", 3, "snapshot", 0, head))
    with pytest.raises(MessageError, match="learn: bands: must be a Snapshot"):
        worker.learn(learn(4, begins=len(head)))
    assert worker.tick == 0
