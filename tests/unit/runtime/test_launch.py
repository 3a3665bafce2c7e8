"""What a launcher tells of a run, and which parts are its own."""

import asyncio
from typing import Any

import msgspec
import pytest

from neurosnap.agent.growth.changed import Changed
from neurosnap.health.alarm import AlarmProgress
from neurosnap.health.news import Standing
from neurosnap.runtime.launch import Jobs, _parts_here, host_jobs
from neurosnap.runtime.parts.job import Advanced, Grown, Health, PartContext, Report
from neurosnap.runtime.request import Site, Watcher
from neurosnap.runtime.supervisor import Supervisor


class NoJob:
    """The job of no part: nothing is started."""

    async def run(self, part: PartContext) -> None:
        raise NotImplementedError


class NoHandle:
    """A part that was never started."""

    def ask(self) -> None:
        raise NotImplementedError

    def kill(self) -> None:
        raise NotImplementedError


def reported(supervisor: Supervisor, *reports: Report) -> None:
    supervisor.began("coordinator", NoHandle())
    for report in reports:
        supervisor.receive(report)


def test_what_parts_report_is_passed_on_in_order() -> None:
    ticks, changes, standings = list[int](), list[Changed](), list[Standing]()
    watcher = Watcher(ticks.append, changes.append, standings.append)
    supervisor, who = Supervisor(watcher=watcher), "coordinator"
    grown = Changed(4, 24, "press&a&b")
    now = [Standing(step, AlarmProgress(9, 40, 0, 2)) for step in (7, 8)]
    health = [Health(who, msgspec.Raw(msgspec.json.encode(each))) for each in now]
    come = [Advanced(who, tick) for tick in (3, 4, 4)]
    reported(supervisor, *come, Grown(who, [grown]), *health)
    assert (ticks, changes, standings) == ([3, 4, 4], [grown], now)
    assert supervisor.health == now[-1]


async def test_an_error_of_the_watcher_ends_the_run_and_it_is_called_no_more() -> None:
    called: list[int] = []

    def refuse(tick: int) -> None:
        called.append(tick)
        raise LookupError("no such part")

    supervisor = Supervisor(watcher=Watcher(refuse))
    come = [Advanced("coordinator", tick) for tick in (1, 2)]
    reported(supervisor, *come)
    with pytest.raises(LookupError, match="no such part"):
        await supervisor.wait(asyncio.Event())
    assert called == [1]


OWN = frozenset({"hub", "coordinator", "cell/0", "cell/1"})
ELSEWHERE = frozenset({"world", "cell/1"})


@pytest.mark.parametrize(
    ("given", "workers", "site", "parts"),
    [
        ({}, 0, Site(), OWN),
        (
            {"world": NoJob(), "status": NoJob()},
            0,
            Site(),
            OWN | {"world", "watcher/outlet"},
        ),
        (
            {"recorder": lambda *_: NoJob()},
            1,
            Site(),
            {"hub", "coordinator", "recorder", "worker/0"},
        ),
        ({"world": NoJob()}, 0, Site(elsewhere=ELSEWHERE), OWN - {"cell/1"}),
    ],
)
def test_the_parts_here_are_those_that_are_not_started_elsewhere(
    given: dict[str, Any], workers: int, site: Site, parts: set[str]
) -> None:
    jobs = Jobs(lambda _: NoJob(), host_jobs(2, workers), **given)
    assert _parts_here(jobs, site) == parts
    assert _parts_here(jobs, site, has_hub=False) == parts - {"hub"}
