"""Who is slow or dead is told by what each part sent, and when."""

from types import SimpleNamespace

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.apps.viewer.slow_cells import Answers, not_waiting
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from tests.support.recorded_runs import path_run
from tests.support.wave_messages import state_wave

FIRST = state_wave(1, 5)
AGAIN = wire.WaveStart(2, 5, "state", 0, 1, (0, 2, 4), repeats=1)


def report(cell: int, wave: int = 1) -> wire.CellReport:
    return wire.CellReport(wave, cell, 0, (), (), (), 0)


def pulse(source: int, target: int, hops: int = 1) -> wire.Pulse:
    return wire.Pulse(1, 2 * source, 2 * target, hops, 1)


def heard(
    *said: tuple[int, wire.Message], options: RunOptions | None = None
) -> Answers:
    """Return what is made of messages, each with when it was sent, in ms."""

    def of_topic(topic: str) -> list[Recorded]:
        return [
            Recorded(message, b"", 0, sent * 10**6, 0)
            for sent, message in said
            if wire.topic(message.key) == topic
        ]

    def of_kind(topic: str, _: type[wire.Leave]) -> list[wire.Message]:
        return [one.message for one in of_topic(topic)]

    answers = Answers(path_run() if options is None else options)
    chunk = SimpleNamespace(of_topic=of_topic, all=of_kind)
    answers.take(chunk, range(1, 9))  # type: ignore[arg-type]
    return answers


def test_silent_is_who_was_asked_and_neither_answered_nor_left() -> None:
    answers = heard((1, FIRST), (2, pulse(0, 3)), (3, wire.Leave("cell/2")))
    assert answers.silent(FIRST, [0, 2, 4]) == [1, 3]


@pytest.mark.parametrize(
    ("edges", "found"), [([(0, 2)], [0]), ([(0, 2), (2, 4)], [0, 1])]
)
def test_who_only_waits_for_a_silent_cell_is_not_named(
    edges: list[tuple[int, int]], found: list[int]
) -> None:
    wired = np.array([source << 32 | target for source, target in edges])
    assert not_waiting([0, 1], [0, 2, 4], wired) == found


def test_a_wave_that_is_repeated_began_with_its_first_start() -> None:
    answers = heard((3, FIRST), (4, report(0)), (9000, AGAIN), (9004, report(1, 2)))
    assert answers.began(AGAIN) == 3 * 10**6
    assert answers.silent(AGAIN, []) == [0, 2]


def test_a_worker_answers_for_its_cells() -> None:
    batch = wire.PulseBatch(1, 0, 1, 0, b"", b"", b"", b"")
    options = path_run(cells="worker", workers=2)
    asked = list(range(0, 2 * len(options.sensors), 2))
    assert heard((0, FIRST), options=options).silent(FIRST, asked) == [0, 1]
    assert heard((0, FIRST), (2, batch), options=options).silent(FIRST, []) == [1]
    done = wire.WorkerReport(1, 1, 0, b"", b"", (), 0)
    answers = heard((0, FIRST), (2, batch), (7, done), options=options)
    assert answers.silent(FIRST, asked) == []
