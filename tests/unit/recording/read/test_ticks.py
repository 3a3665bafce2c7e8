import random
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.read import ticks as module
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import InOrder, Tick, ticks
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import delivered, record


def messages(tick: int) -> list[wire.Message]:
    return [
        wire.Observation(tick, b"\x01"),
        wire.State(tick, tick, b"\x02", False, 1, 1, 1, 1, 1),
        wire.Decision(tick, 0, "why"),
    ]


def found(path: Path, sent: list[wire.Message]) -> list[Tick]:
    record(path, delivered(sent))
    return list(ticks(Recording.open(path)))


def test_ticks_come_in_order_whatever_order_their_messages_came_in(
    tmp_path: Path,
) -> None:
    sent = [message for tick in range(1, 30) for message in messages(tick)]
    chance = random.Random(1)
    # A sort by tick and a little noise: what is near each other gets mixed.
    sent = [
        sent[k]
        for k in sorted(range(len(sent)), key=lambda k: k + chance.random() * 12)
    ]
    got = found(tmp_path / "log.mcap", [wire.Decision(0, -1, "the run begins"), *sent])
    assert [tick.number for tick in got] == list(range(1, 30))
    for tick in got:
        assert [tick.observation, tick.state, tick.decision] == messages(tick.number)


def test_a_tick_is_given_out_as_soon_as_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    record(path, delivered([*messages(1), *messages(2)]))
    recording = Recording.open(path)
    order = InOrder(recording)
    given = [len(order.add(each)) for each in recording.messages(module.TOPICS)]
    assert given == [0, 0, 1, 0, 0, 1]


def test_a_tick_that_lost_something_comes_in_its_place(tmp_path: Path) -> None:
    sent = [*messages(1), messages(2)[1], *messages(3), messages(4)[0]]
    got = found(tmp_path / "log.mcap", sent)
    assert [tick.number for tick in got] == [1, 2, 3, 4]
    assert [tick.known for tick in got] == [True, False, True, False]


def test_no_more_than_the_window_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "WINDOW", 4)
    path = tmp_path / "log.mcap"
    record(path, delivered(messages(tick)[0] for tick in range(1, 20)))
    recording = Recording.open(path)
    order = InOrder(recording)
    given = [tick for each in recording.messages() for tick in order.add(each)]
    assert [tick.number for tick in given] == list(range(1, 16))
    assert [tick.number for tick in order.rest()] == list(range(16, 20))


def test_what_comes_after_its_tick_is_an_error(tmp_path: Path) -> None:
    again = [*messages(1), *messages(2), messages(1)[1]]
    with pytest.raises(
        RecordingError, match=r"log\.mcap: tick: must come once, .* got 1$"
    ):
        found(tmp_path / "log.mcap", again)


def test_a_later_file_begins_with_its_own_first_tick(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with Writer(path) as writer:
        writer.start({"part": "1", "begins": "6"})
        for delivery in delivered([messages(6)[2], *messages(7)]):
            writer.add(delivery, delivery.sent)
        writer.finish({}, {})
    recording = Recording.open(path)
    order = InOrder(recording)
    given = [order.add(each) for each in recording.messages()]
    assert [[tick.number for tick in due] for due in given] == [[], [], [], [7]]
