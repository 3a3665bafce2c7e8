"""A run that is fed numbered lines by a pipe, while parts of it are killed.

The run is a process of its own, as its user starts it. It tells how far it is as it
tells a service manager, and of its restarts on stderr. What comes by the pipe comes
once: whoever is killed, each line must be a tick once, and they must be in order.
"""

import asyncio
import json
import os
import re
import socket
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import psutil

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import unpack
from tools.soak.killer import Killer

BITS = 12
"""Sensors: the lower bits of a line's number."""
_SIZE = 1 << BITS
_WATCHDOG = 100_000  # microseconds; progress is told twice as often
_RESTART = re.compile(r"going on from tick (\d+): .*?(?:; (\d+) ticks are done again)?")


class Lines(msgspec.Struct, kw_only=True):
    """What is recorded of numbered lines."""

    lost: int
    doubled: int
    exact: bool
    """Each is there once, and they are in order."""


async def feed(
    killer: Killer, log: Path, rate: float, flags: Sequence[str] = ()
) -> tuple[int, int]:
    """Make the run; its input ends once enough is killed and it has gone on.

    Args:
        killer: Kills parts of it.
        log: Where it is recorded.
        rate: Lines a second, if the pipe takes so many.
        flags: More of the run.

    Returns:
        How many lines it was fed, and its exit code. What it says on stderr, but for
        restarts, is passed on.
    """
    sensors = ",".join(f"bit{place}" for place in range(BITS))
    given = ("--set", f"sensors={sensors}", "--out", str(log), *flags)
    with _service_manager() as (manager, address):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "neurosnap", "run", "-", *given),
            stdin=PIPE,
            stdout=DEVNULL,
            stderr=PIPE,
            env=os.environ
            | {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": str(_WATCHDOG)},
        )
        if process.stdin is None or process.stderr is None:
            raise ValueError("process: must have pipes, got none")
        loop = asyncio.get_running_loop()
        loop.add_reader(manager, _follow, manager, killer)
        try:
            async with asyncio.TaskGroup() as group:
                hunting = group.create_task(killer.hunt(psutil.Process(process.pid)))
                feeding = group.create_task(_feed(process.stdin, rate, hunting))
                async for raw in process.stderr:
                    line = raw.decode().rstrip()
                    if restart := _RESTART.fullmatch(line):
                        _follow(manager, killer)  # what it told before
                        killer.restarted(int(restart[1]), int(restart[2] or 0))
                    else:
                        print(line, file=sys.stderr)
                hunting.cancel()  # the run is over, however many are left to kill
        finally:
            loop.remove_reader(manager)
            with suppress(ProcessLookupError):
                process.kill()  # it has ended, if all went well
            code = await process.wait()
    return feeding.result(), code


async def _feed(
    pipe: asyncio.StreamWriter, rate: float, hunting: "asyncio.Task[None]"
) -> int:
    """Write lines until the hunt is over, and return how many.

    Each is one write, as by whoever flushes each line: a pipe takes all of it or none.
    """
    pipe.transport.set_write_buffer_limits(0)
    began, number = time.monotonic(), 0
    with suppress(ConnectionError):
        while not hunting.done():
            number += 1
            bits = [number >> place & 1 for place in range(BITS)]
            pipe.write(json.dumps({"bits": bits}).encode() + b"\n")
            await pipe.drain()
            await asyncio.sleep(began + number / rate - time.monotonic())
        pipe.close()
        await pipe.wait_closed()
    return number


def lines_in(log: Path, lines: int) -> Lines:
    """Return what a recording holds of so many lines."""
    heard = [each.message for each in Recording.open(log).messages(("observation",))]
    readings = [unpack(m.bits, BITS) for m in heard if isinstance(m, wire.Observation)]
    return compared(
        (sum(int(bit) << place for place, bit in enumerate(each)) for each in readings),
        lines,
    )


def compared(readings: Iterable[int], lines: int) -> Lines:
    """Return what there is of so many lines.

    Args:
        readings: The lower bits of their numbers. Each stands for the number that is
            nearest to the one after the one before.
        lines: How many there should be.
    """
    numbers: list[int] = []
    half = _SIZE // 2
    for reading in readings:
        due = numbers[-1] + 1 if numbers else 1
        numbers.append(due + (reading - due + half) % _SIZE - half)
    every = range(1, lines + 1)
    return Lines(
        lost=len({*every} - {*numbers}),
        doubled=len(numbers) - len({*numbers}),
        exact=numbers == [*every],
    )


@contextmanager
def _service_manager() -> Iterator[tuple[socket.socket, str]]:
    """Yield a socket that hears how far a run is, and its address for the run."""
    name = f"neurosnap-soak-{os.getpid()}-{time.monotonic_ns()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(f"\0{name}")
        listening.setblocking(False)
        yield listening, f"@{name}"


def _follow(manager: socket.socket, killer: Killer) -> None:
    with suppress(BlockingIOError):
        while True:
            _, _, tick = manager.recv(4096).decode().partition("STATUS=tick ")
            if tick:
                killer.follow(int(tick))
