"""What a launcher tells of a run, and which parts are its own."""

import asyncio
from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap.agent.growth.changed import Changed
from neurosnap.health.alarm import Progress
from neurosnap.health.news import Standing
from neurosnap.runtime.launch import Plan, _Heard, _parts_here
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.job import PartContext
from neurosnap.runtime.supervisor import Supervisor


class NoJob:
    """The job of no part: nothing is started."""

    async def run(self, part: PartContext) -> None:
        raise NotImplementedError


async def test_progress_is_passed_on_when_it_is_said_and_not_again() -> None:
    supervisor, heard, heard_of = Supervisor(), list[int](), list[Changed]()
    standings = list[Standing]()
    passes = _Heard(supervisor, heard.append, heard_of.append, standings.append)
    reporting = asyncio.create_task(passes.pass_on())
    for tick in (3, 4, 4):
        supervisor.tick = tick
        supervisor.progressed.set()
        for _ in range(5):
            await asyncio.sleep(0)
    assert heard == [3, 4, 4]
    assert heard_of == []
    assert standings == []
    now = [Standing(step, Progress(9, 40, 0, 2)) for step in (7, 8)]
    supervisor.standings += map(msgspec.json.encode, now)
    supervisor.changes.append(grown := Changed(4, 24, "press&a&b"))
    supervisor.progressed.set()
    for _ in range(5):
        await asyncio.sleep(0)
    assert heard_of == [grown]
    assert not supervisor.changes
    assert not supervisor.standings
    assert standings == now
    assert passes.health == now[-1]
    reporting.cancel()
    await asyncio.wait({reporting})


async def test_an_error_of_who_is_told_ends_the_run() -> None:
    def refuse(_: int) -> None:
        raise LookupError("no such part")

    supervisor = Supervisor()
    supervisor.progressed.set()
    await _Heard(supervisor, refuse, lambda _: None, lambda _: None).pass_on()
    with pytest.raises(LookupError, match="no such part"):
        await supervisor.wait(asyncio.Event())


OWN = frozenset({"hub", "coordinator", "cell/0", "cell/1"})
ELSEWHERE = frozenset({"world", "cell/1"})


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ({}, OWN),
        ({"world": NoJob(), "status": NoJob()}, OWN | {"world", "watcher/outlet"}),
        (
            {"log": Path("log"), "workers": 1},
            {"hub", "coordinator", "recorder", "worker/0"},
        ),
        (
            {"network": Network(connect="tcp/127.0.0.1:7"), "elsewhere": ELSEWHERE},
            {"coordinator", "cell/0"},
        ),
        ({"world": NoJob(), "elsewhere": ELSEWHERE}, OWN - {"cell/1"}),
    ],
)
def test_the_parts_here_are_those_that_nobody_else_starts(
    given: dict[str, Any], parts: set[str]
) -> None:
    plan = Plan(cells=2, coordinator=lambda _: NoJob(), **given)
    assert _parts_here(plan) == parts
