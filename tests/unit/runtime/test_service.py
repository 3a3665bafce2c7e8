"""A coordinator's description of a run, and how services learn its outcome."""

import asyncio

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.runtime import remote_parts, service
from neurosnap.runtime.parts import coordinator_process
from neurosnap.runtime.parts.coordinator_process import RunDescription, read_description
from neurosnap.runtime.parts.worker_process import WorkerJob
from neurosnap.runtime.service import _Ending
from tests.support.patience import PATIENCE

PAST = ResumePoint("/far/away.mcap", 7, (1, 0), b"\x01", {"cell/0": 12}, (7,))


def brief(
    cells: CellKind = "process", past: ResumePoint | None = None
) -> RunDescription:
    body = Body(own=("a", "b", "c"))
    options = RunOptions(source="readings.csv", body=body, cells=cells, workers=2)
    return RunDescription(options=options, past=past, vacant=("cell/0", "world"))


def test_a_brief_comes_as_it_went_but_for_the_path() -> None:
    assert read_description(brief().to_bytes()) == brief()
    past = msgspec.structs.replace(PAST, log="")
    assert read_description(brief(past=PAST).to_bytes()) == brief(past=past)


@pytest.mark.parametrize("content", [b"", b"{}", b"\xff", b'{"options": 3}', b"[]"])
def test_what_is_no_brief_is_refused(content: bytes) -> None:
    with pytest.raises(SwarmError, match=r"^coordinator: must tell what the run is"):
        read_description(content)


def test_a_part_goes_on_with_its_own_numbers() -> None:
    assert brief().first("cell/0") == 0
    assert brief(past=PAST).first("cell/0") == 12
    assert brief(past=PAST).first("cell/1") == 0


def test_only_what_is_missing_may_be_filled() -> None:
    brief().check_vacant(["world", "cell/0"])
    rule = r"^part: must be one the run leaves to others: cell/0, world, got 'cell/1'"
    with pytest.raises(InvalidValueError, match=rule):
        brief().check_vacant(["cell/0", "cell/1"])
    many = msgspec.structs.replace(brief(), vacant=tuple(map(str, range(20))))
    with pytest.raises(InvalidValueError, match=r"6, 7 and 12 more, got 'x'"):
        many.check_vacant(["x"])


def test_workers_learn_how_many_there_are() -> None:
    (duty,) = remote_parts.cells([1])("demo", brief("worker"))
    assert (duty.who, duty.job) == (
        "worker/1",
        WorkerJob(1, 3, 2, brief("worker").options),
    )


class Meeting(ZenohFabric):
    """Where one group of parts after the other is found, then always the last."""

    def __init__(self, *groups: set[str]) -> None:
        self.groups = list(groups)

    async def present(self) -> set[str]:
        return self.groups.pop(0) if len(self.groups) > 1 else self.groups[0]


async def test_a_coordinator_waits_until_nobody_is_left_of_another_run() -> None:
    meeting = Meeting({"world", "cell/0"}, {"world", "cell/7"}, {"cell/7"})
    await coordinator_process._wait_alone(
        meeting, "demo", ["world", "cell/0"], asyncio.Event()
    )
    assert meeting.groups == [{"cell/7"}]  # which is its own


async def test_a_second_coordinator_gives_up_at_once() -> None:
    with pytest.raises(SwarmError, match=r"^swarm demo: must have one coordinator"):
        meeting = Meeting({"coordinator", "world"})
        await coordinator_process._wait_alone(meeting, "demo", [], asyncio.Event())


async def test_a_coordinator_that_waits_for_others_to_leave_can_be_stopped() -> None:
    stop = asyncio.Event()
    waiting = asyncio.create_task(
        coordinator_process._wait_alone(Meeting({"world"}), "demo", ["world"], stop)
    )
    await asyncio.sleep(0)
    assert not waiting.done()
    stop.set()
    async with asyncio.timeout(PATIENCE):
        await waiting


async def test_who_does_not_leave_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coordinator_process, "_LEFTOVER", 0.01)
    rule = r"^swarm demo: must have no part left of .* has cell/0, world$"
    with pytest.raises(SwarmError, match=rule):
        meeting = Meeting({"world", "cell/0"})
        await coordinator_process._wait_alone(
            meeting, "demo", ["cell/0", "world"], asyncio.Event()
        )


def said(sequence: int, message: wire.Message) -> wire.Delivery:
    return wire.Delivery(message.key, sequence, 0, wire.encode(message))


FAULT = wire.Fault("coordinator", "ValueError: no")
LEAVE = wire.Leave("coordinator")
VANISHED = "its coordinator vanished without a word"


@pytest.mark.parametrize(
    ("heard", "trouble"),
    [
        ([said(8, LEAVE)], ""),
        ([said(7, FAULT), said(8, LEAVE)], "ValueError: no"),
        ([said(5, FAULT), said(8, LEAVE)], ""),  # a message that it dropped
        ([said(7, wire.Fault("cell/0", "no")), said(8, LEAVE)], ""),
        ([said(7, FAULT)], VANISHED),
        ([said(8, wire.Leave("cell/0"))], VANISHED),
        ([wire.Delivery("leave", 0, 0, b"{")], VANISHED),
    ],
)
async def test_the_last_words_tell_how_a_run_ended(
    heard: list[wire.Delivery], trouble: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "_LAST_WORD", 0.01)
    ending = _Ending()
    for each in heard:
        ending.handle([each])
    assert await ending.trouble() == trouble


def test_a_service_hears_that_a_part_of_its_own_is_refused() -> None:
    ending = _Ending()
    ending.own = {"worker/0/ab12"}
    for who, refused in (("worker/0/cd34", False), ("worker/0/ab12", True)):
        what = f"{who}: must be there once, is the second of its name"
        ending.handle([said(3, wire.Fault("coordinator", what))])
        assert ending.refused.is_set() is refused
        assert ending.complaint == what
