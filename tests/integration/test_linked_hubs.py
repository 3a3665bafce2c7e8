"""A swarm over three hubs: cells join at two of them, the rest is at the third.

The hubs are in a line, with a link that takes its time, can be cut, and counts what
crosses it.
"""

import asyncio
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple, Self

import pytest

from neurosnap import wire
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.commands import Command
from tests.support.course import course
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.recorded_messages import assert_true_run
from tests.support.services import (
    ENDLESS,
    PATH,
    SWARM,
    begun,
    ended,
    going,
    in_one_piece,
    up,
)

_HOST = "127.0.0.1"
_CHUNK = 1 << 16


class SlowLink:
    """Passes on every connection to `port` to a hub on this machine.

    What it holds back is delivered in order when its time has come. Nothing is lost: on
    a real network TCP sends it again, so that loss is delay, too.

    Args:
        port: Where it listens.
        target: Where the hub listens.
        delay: Seconds that anything takes to cross it.
    """

    def __init__(self, port: int, target: int, delay: float = 0.0) -> None:
        self._listener = socket.create_server((_HOST, port))
        self._target = target
        self._delay = delay
        self._whole = threading.Event()
        self._whole.set()
        self._lock = threading.Lock()  # for the next two
        self._broken = False
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, name="slow link")]

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)  # which ends `accept`
        self._threads[0].join()
        self._listener.close()
        self.sever()
        self._whole.set()
        for thread in self._threads[1:]:
            thread.join()
        for end in self._ends:
            end.close()

    def cut(self) -> None:
        """Hold back everything, both ways, until `heal`; neither end is told."""
        self._whole.clear()

    def heal(self) -> None:
        """Deliver what was held back, and whatever comes."""
        with self._lock:
            self._broken = False
        self._whole.set()

    def sever(self) -> None:
        """Close all connections, and refuse others until `heal`."""
        with self._lock:
            self._broken = True
            for end in self._ends:
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                with self._lock:
                    if self._broken or not self._connect(near):
                        near.close()

    def _connect(self, near: socket.socket) -> bool:
        """Pass on what comes, both ways; return whether the hub is there."""
        try:
            far = socket.create_connection((_HOST, self._target))
        except OSError:
            return False
        self._ends += [near, far]
        for ends in (near, far), (far, near):
            thread = threading.Thread(target=self._pass_on, args=ends)
            self._threads.append(thread)
            thread.start()
        return True

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while chunk := one.recv(_CHUNK):
                time.sleep(self._delay)  # it is the link that is slow
                self._whole.wait()
                other.sendall(chunk)
        with suppress(OSError):
            other.shutdown(socket.SHUT_RDWR)  # the one end has gone, so this one goes


pytestmark = [pytest.mark.zenoh, pytest.mark.slow]
ELSEWHERE = ("--swarm", SWARM, "--elsewhere", "2-5")
DELAY = 0.005  # seconds over the slow link, one way


class Hubs(NamedTuple):
    """Three hubs in a line, from first to last, and the link in front of the last."""

    first: str
    second: str
    last: str
    link: SlowLink
    start: Callable[[], Command]
    """Starts the last one; it is there when this returns."""


@contextmanager
def line() -> Iterator[Hubs]:
    """Three hubs, of which the last is reached over a slow link."""
    ports = [free_port() for _ in range(4)]
    first, second, last, slow = (f"tcp/127.0.0.1:{port}" for port in ports)

    with ExitStack() as stack:

        def start(endpoint: str, *links: str) -> Command:
            more = [word for link in links for word in ("--link", link)]
            hub = stack.enter_context(
                going("serve", "hub", "--listen", endpoint, *more)
            )
            assert "listening on" in hub.stderr.readline()
            return hub

        hubs = [start(first), start(second, first)]
        link = stack.enter_context(SlowLink(ports[3], ports[1], DELAY))
        given = Hubs(first, second, last, link, lambda: start(last, slow))
        yield given
        for hub in hubs:
            hub.send_signal(signal.SIGINT)
            ended(hub)


@contextmanager
def shares(hubs: Hubs) -> Iterator[list[Command]]:
    """Four cells of the run, two on the second hub and two on the last."""
    with (
        going("serve", "cells", SWARM, "--connect", hubs.second, "2,3") as near,
        going("serve", "cells", SWARM, "--connect", hubs.last, "4,5") as far,
    ):
        yield [near, far]


def is_right(log: Path, ticks: int, folder: Path) -> None:
    """Check that nothing is missing, and that the run is what it is in one process."""
    assert_true_run(log, ticks=ticks)
    assert course(log) == course(in_one_piece(ticks, folder / "inline"))


@contextmanager
def running(
    log: Path,
    *more: object,
    whole: bool = True,
    before: Callable[[Hubs], None] = lambda _: None,
) -> Iterator[tuple[Hubs, Command, Command]]:
    """A run with cells at all three hubs: these, the last one, and the launcher.

    All of it has ended in order when this is left, unless it is left to itself.
    """
    with line() as hubs:
        before(hubs)
        last = hubs.start()
        run = ("run", PATH, *ENDLESS, *ELSEWHERE, *more, "--out", log)
        with (
            shares(hubs) as joined,
            going(*run, "--connect", hubs.first) as most,
        ):
            yield hubs, last, most
            if whole:
                ended(most)
                for each in joined:
                    ended(each)


def test_three_hubs_make_one_swarm(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    with running(log, "--ticks", 40) as (_, last, _):
        assert last.stderr.readline().startswith("linked with the hub at tcp/127.0.0.1")
    is_right(log, 40, tmp_path)
    parts = Recording.open(log).noted().expected
    assert {f"cell/{cell}" for cell in range(6)} <= set(parts)


@pytest.mark.exhaustive
def test_services_wait_for_a_hub_that_is_linked_late(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    late = running(log, "--ticks", 10, before=lambda hubs: hubs.link.sever())
    with late as (hubs, last, _):
        assert "waiting for a hub at" in last.stderr.readline()
        up(hubs.first, "cell/2")
        hubs.link.heal()
    is_right(log, 10, tmp_path)


@pytest.mark.exhaustive
def test_a_link_that_is_cut_and_heals_costs_nothing(tmp_path: Path) -> None:
    """Whatever is held back is delivered; a wave that was late is asked for again."""
    log = tmp_path / "log.mcap"
    with running(log, "--set", "cells.deadline=2") as (hubs, _, most):
        begun(hubs.first, 5)
        asyncio.run(cut_until_asked_again(hubs))
        begun(hubs.first, 15)
        most.send_signal(signal.SIGINT)
    is_right(log, verify(log).ticks, tmp_path)


def test_parts_behind_a_lost_link_are_named_and_the_recording_reads(
    tmp_path: Path,
) -> None:
    log = tmp_path / "log.mcap"
    mortal = running(log, "--set", "supervision.max_restarts=0", whole=False)
    with mortal as (hubs, last, most):
        begun(hubs.first, 6)
        hubs.link.sever()
        while "lost the link with the hub at" not in (heard := last.stderr.readline()):
            assert heard, "it ended without a word of the link"
        said = ended(most, 1)
    assert "cell/4" in said or "cell/5" in said
    verdict = verify(log)
    assert verdict.same
    assert verdict.ticks >= 5  # the sixth had begun


@pytest.mark.exhaustive
def test_a_run_goes_on_when_a_hub_is_killed_and_comes_back(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    with running(log) as (hubs, last, most):
        begun(hubs.first, 5)
        last.kill()
        hubs.start()
        begun(hubs.first, 15, f"{SWARM}-1")
        most.send_signal(signal.SIGINT)
    is_right(log, verify(log).ticks, tmp_path)


async def cut_until_asked_again(hubs: Hubs) -> None:
    """Cut the link, and heal it when a wave was late and is started again."""
    again = asyncio.Event()

    def handle(burst: list[wire.Delivery]) -> None:
        for each in burst:
            message = wire.decode(each.key, each.payload)
            if isinstance(message, wire.WaveStart) and message.repeats:
                again.set()

    async with ZenohFabric("watcher", SWARM, HubAddress(hubs.first)) as fabric:
        await fabric.subscribe(("wavestart", "wavestart/**"), handle)
        await fabric.confirm()
        hubs.link.cut()
        async with asyncio.timeout(PATIENCE):
            await again.wait()
        hubs.link.heal()
