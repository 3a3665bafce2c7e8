"""What a launcher tells of a run, and which parts are its own."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from neurosnap.agent.growth.changed import Changed
from neurosnap.runtime.launch import Plan, _parts_here, _report
from neurosnap.runtime.network import Network
from neurosnap.runtime.parts.job import PartContext
from neurosnap.runtime.supervisor import Supervisor


class NoJob:
    """The job of no part: nothing is started."""

    async def run(self, part: PartContext) -> None:
        raise NotImplementedError


async def test_progress_is_passed_on_when_it_is_said_and_not_again() -> None:
    supervisor, heard, heard_of = Supervisor(), list[int](), list[Changed]()
    reporting = asyncio.create_task(_report(supervisor, heard.append, heard_of.append))
    for tick in (3, 4, 4):
        supervisor.tick = tick
        supervisor.progressed.set()
        for _ in range(5):
            await asyncio.sleep(0)
    assert heard == [3, 4, 4]
    assert heard_of == []
    supervisor.changes.append(grown := Changed(4, 24, "press&a&b"))
    supervisor.progressed.set()
    for _ in range(5):
        await asyncio.sleep(0)
    assert heard_of == [grown]
    assert supervisor.changes == []
    reporting.cancel()
    await asyncio.wait({reporting})


async def test_an_error_of_who_is_told_ends_the_run() -> None:
    def refuse(_: int) -> None:
        raise LookupError("no such part")

    supervisor = Supervisor()
    supervisor.progressed.set()
    await _report(supervisor, refuse, lambda _: None)
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
