"""A supervisor forwards its parts' reports, and stops them when it ends."""

import asyncio
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.health.alarm import AlarmProgress, Standing
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.runtime.child_processes import ChildProcesses, without_main
from neurosnap.runtime.parts.job import (
    Advanced,
    Found,
    Grown,
    Health,
    Job,
    PartConnection,
    PartContext,
    Ready,
    Report,
    WavesSoFar,
)
from neurosnap.runtime.request import Watcher
from neurosnap.runtime.supervisor import Supervisor


class Process:
    """A child that is nothing but a pipe, which closes when it is killed."""

    def __init__(self, name: str, starts: Callable[[str], None]) -> None:
        self.name = name
        self.exitcode: int | None = None
        self.sentinel, self._end = os.pipe()
        self._starts = starts

    def start(self) -> None:
        self._starts(self.name)

    def kill(self) -> None:
        if self.exitcode is None:
            self.exitcode = -9
            os.close(self._end)

    def join(self) -> None:
        assert self.exitcode is not None, "nobody waits for one that goes on"

    def close(self) -> None:
        os.close(self.sentinel)


class Children:
    """Makes such children; each start waits until it is let go on, or is refused."""

    def __init__(self, refused: bool = False) -> None:
        self._refused = refused
        self.started: list[str] = []
        self.is_starting = asyncio.Event()
        self.go_on = threading.Event()
        self._made: list[Process] = []
        self._loop = asyncio.get_running_loop()

    def process(self, name: str) -> Process:
        self._made.append(Process(name, self._start))
        return self._made[-1]

    def _start(self, name: str) -> None:
        if self._refused:
            raise OSError("no more processes")
        self._loop.call_soon_threadsafe(self.is_starting.set)
        assert self.go_on.wait(5)
        self.started.append(name)

    def close(self) -> dict[str, int | None]:
        """Return how those ended that were started; free the others."""
        for process in self._made:
            if process.name not in self.started:
                process.kill()
                process.close()
        return {p.name: p.exitcode for p in self._made if p.name in self.started}


class NoJob:
    """A job of nothing: no child of these tests gets that far."""

    async def run(self, part: PartContext) -> None:
        raise NotImplementedError


class Starting(ChildProcesses):
    """Starts such children."""

    def __init__(self, children: Children) -> None:
        super().__init__()
        self._makes = children.process

    def _process(self, job: Job, connection: PartConnection, line: Any) -> Any:
        self.line = line
        return self._makes(connection.who)


def jobs(count: int) -> list[tuple[Job, PartConnection]]:
    connections = [PartConnection(f"cell/{n}", "demo") for n in range(count)]
    return [(NoJob(), connection) for connection in connections]


@pytest.mark.parametrize("many", [True, False])
async def test_who_is_cancelled_while_it_starts_leaves_nobody(many: bool) -> None:
    children = Children()

    async def start() -> None:
        async with Supervisor(Starting(children)) as supervisor:
            if many:
                await supervisor.start_many(jobs(3))
            else:
                await supervisor.start(*jobs(1)[0])

    starting = asyncio.create_task(start())
    await children.is_starting.wait()
    starting.cancel()
    for _ in range(3):  # it is leaving, and has to wait for the one under way
        await asyncio.sleep(0)
    assert not starting.done()
    children.go_on.set()
    with pytest.raises(asyncio.CancelledError):
        await starting
    assert children.close() == {"cell/0": -9}


async def test_a_line_is_closed_here_even_if_its_child_does_not_start() -> None:
    children = Children(refused=True)
    starting = Starting(children)
    async with Supervisor(starting) as supervisor:
        with pytest.raises(OSError, match="no more processes"):
            await supervisor.start(*jobs(1)[0])
        assert starting.line.closed
    assert children.close() == {}


class Listening(Supervisor):
    """A supervisor that notes that it was told something."""

    def __init__(self, starting: Starting) -> None:
        super().__init__(starting)
        self.told = asyncio.Event()

    def receive(self, report: Report) -> None:
        super().receive(report)
        self.told.set()


async def test_who_is_up_before_its_start_has_returned_is_up() -> None:
    children = Children()
    lines = Starting(children)
    async with Listening(lines) as supervisor:
        starting = asyncio.create_task(supervisor.start(*jobs(1)[0]))
        await children.is_starting.wait()
        lines.line.send_bytes(msgspec.json.encode(Ready("cell/0")))
        await supervisor.told.wait()
        children.go_on.set()
        part = await starting
        assert part.ready.is_set()
    assert children.close() == {"cell/0": -9}


async def test_whoever_waits_hears_what_was_blamed() -> None:
    async with Supervisor(Starting(Children())) as supervisor:
        ready = asyncio.Event()
        ready.set()
        await supervisor.wait(ready)
        waiting = asyncio.create_task(supervisor.wait(asyncio.Event()))
        await asyncio.sleep(0)
        supervisor.blame(ValueError("no"))
        with pytest.raises(ValueError, match="no"):
            await waiting
        with pytest.raises(ValueError, match="no"):
            await supervisor.wait(ready)


def test_two_that_hide_the_main_module_leave_it_as_it_was() -> None:
    main, inside, leave = sys.modules["__main__"], threading.Event(), threading.Event()

    def hide() -> None:
        with without_main():
            inside.set()
            leave.wait(5)

    other = threading.Thread(target=hide)
    with without_main():
        other.start()
        assert not inside.wait(0.05), "they must take turns"
    leave.set()
    other.join()
    assert inside.is_set()
    assert sys.modules["__main__"] is main


# What parts report --------------------------------------------------------------------


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
    waves, found = list[WavesSoFar](), list[NamedAnomaly]()
    watcher = Watcher(
        ticks.append,
        changes.append,
        standings.append,
        on_waves=waves.append,
        on_anomaly=found.append,
    )
    supervisor, who = Supervisor(watcher=watcher), "coordinator"
    grown = Changed(4, 24, "press&a&b")
    now = [Standing(step, AlarmProgress(9, 40, 0, 2)) for step in (7, 8)]
    health = [Health(who, msgspec.Raw(msgspec.json.encode(each))) for each in now]
    so_far, anomaly = WavesSoFar(4, 9), NamedAnomaly(4, 4, ("a",), (), True, (), 0, "")
    come = [Advanced(who, 3), Advanced(who, 4, so_far), Advanced(who, 4)]
    told = Found(who, msgspec.Raw(msgspec.json.encode(anomaly)))
    reported(supervisor, *come, told, Grown(who, [grown]), *health)
    assert (ticks, changes, standings) == ([3, 4, 4], [grown], now)
    assert (waves, found) == ([so_far], [anomaly])
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
