"""The world has a deadline for its answer, unless what it shows is outside."""

import logging

import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import PartDiedError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.coordinator_loop import WorldDeadline
from neurosnap.runtime.parts.coordinator_process import answer_within

DECISION = wire.Decision(6, -1, "why")
WAVE = wire.WaveStart(1, 7, "state", 0, 1)


class Clock:
    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        patch.setattr(
            "neurosnap.runtime.parts.coordinator_loop.time.monotonic", lambda: self.now
        )


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return Clock(monkeypatch)


def test_a_world_that_does_not_answer_is_named(clock: Clock) -> None:
    answer = WorldDeadline(3.0)
    answer.published(DECISION)
    clock.now += 3.0
    answer.check()
    clock.now += 0.1
    said = r"^world: must answer the decision of tick 6 within 3 s, got nothing$"
    with pytest.raises(PartDiedError, match=said):
        answer.check()


def test_who_is_waited_for_is_said_once_a_decision(
    clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    answer = WorldDeadline(3.0)
    with caplog.at_level(logging.WARNING):
        for tick in (6, 7):
            answer.published(wire.Decision(tick, -1, ""))
            for _ in range(5):
                clock.now += 0.5
                answer.check()
    assert caplog.messages == [
        "waiting for world: tick 7, 1.5 s",
        "waiting for world: tick 8, 1.5 s",
    ]


def test_an_answer_in_time_ends_the_wait(clock: Clock) -> None:
    answer = WorldDeadline(3.0)
    answer.published(DECISION)
    clock.now += 2.0
    answer.published(WAVE)
    clock.now += 60.0  # of waves, which have deadlines of their own
    answer.check()
    answer.published(wire.State(7, 1, b"", False, 0, 0, 0, 0, 0))
    answer.check()


def test_before_the_run_begins_nobody_is_waited_for(clock: Clock) -> None:
    answer = WorldDeadline(3.0)
    clock.now += 60.0
    answer.check()


def test_who_is_outside_takes_as_long_as_it_takes(clock: Clock) -> None:
    answer = WorldDeadline(None)
    answer.published(DECISION)
    clock.now += 10**6
    answer.check()


@pytest.mark.parametrize(
    ("source", "seconds"),
    [("-", None), ("zenoh:", None), ("mqtt:", None), ("log.csv", 6.0)],
)
def test_only_what_is_outside_has_no_deadline(
    source: str, seconds: float | None
) -> None:
    options = RunOptions(source=source, body=Body(own=("a",)), deadline=2.0)
    assert answer_within(options) == seconds
