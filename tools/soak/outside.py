"""A run that is fed numbered readings from outside, while parts of it are killed.

The run is a process of its own, as its user starts it. It tells how far it is as it
tells a service manager, and of its restarts on stderr. What comes by a pipe or over
Zenoh comes once: each reading must be a tick once, in order. Of what a broker sends, or
comes for one sensor alone, a tick has the latest: what became of each must be said.
"""

import asyncio
import json
import os
import re
import signal
import socket
import sys
import threading
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import psutil
import zenoh
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from neurosnap import wire
from neurosnap.fabric.zenoh.connect_session import configuration
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import unpack
from neurosnap.sources.ros2.graph import open_session
from neurosnap.sources.ros2.keys_and_tokens import Qos
from neurosnap.sources.ros2.node import RosNode
from tests.support.mosquitto import started
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.senders import Send, by_zenoh, listened_to
from tools.soak.killer import Killer

BITS = 12
"""Sensors: the lower bits of a line's number."""
SINGLY = "zenoh:singly"
"""A reading of one sensor after another: a tick has the latest of each."""
ROS2 = "ros2:"
"""A message of ROS 2 for each: what is published while nothing listens is lost."""
_NAMES = [f"bit{place}" for place in range(BITS)]
_SIZE = 1 << BITS
_ALL = ("max_queued_messages 0",)
"""Of a broker: it would drop what more than 1,000 others wait before."""
_STILL = 3.0  # seconds in which nothing is written once nothing comes
_AHEAD = 1000  # messages not yet acknowledged; a client silently drops what is too many
_WATCHDOG = 100_000  # microseconds; progress is told twice as often
_RESTART = re.compile(r"going on from tick (\d+): .*?(?:; (\d+) ticks are done again)?")


class Lines(msgspec.Struct, kw_only=True):
    """What is recorded of numbered lines."""

    lost: int
    doubled: int
    exact: bool
    """Each is there once, and they are in order."""


async def feed(
    killer: Killer, log: Path, rate: float, flags: Sequence[str] = (), by: str = "-"
) -> tuple[int, int, dict[str, int]]:
    """Make the run; its input ends once enough is killed and it has gone on.

    Args:
        killer: Kills parts of it.
        log: Where it is recorded.
        rate: Readings a second, if the run takes so many.
        flags: More of the run.
        by: How it is fed: ``-``, ``zenoh:``, ``zenoh:singly``, ``mqtt:`` or ``ros2:``.

    Returns:
        How many readings it was fed, its exit code, and what it counted. What it says
        on stderr, but for restarts, is passed on.
    """
    with (
        _service_manager() as (manager, address),
        outside(by, log.parent, *_ALL) as way,
    ):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "neurosnap", "run", *way.source),
            *("--out", str(log), "--format", "json", *flags),
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            env=os.environ
            | {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": str(_WATCHDOG)},
        )
        if not (process.stdin and process.stdout and process.stderr):
            raise ValueError("process: must have pipes, got none")
        loop = asyncio.get_running_loop()
        loop.add_reader(manager, _follow, manager, killer)
        try:
            async with asyncio.TaskGroup() as group:
                hunting = group.create_task(killer.hunt(psutil.Process(process.pid)))
                telling = group.create_task(process.stdout.read())
                feeding = group.create_task(_feed(process, way, rate, hunting, log))
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
    facts = json.loads(telling.result().splitlines()[-1]) if code in (0, 3) else {}
    return feeding.result(), code, facts.get("readings", {})


class Outside(NamedTuple):
    """Where readings come from: how the run is told of it, and how they are sent."""

    source: tuple[str, ...]
    connect: Callable[[Process], Send]
    """Called once the run has begun; returns what sends a reading."""


async def _feed(
    process: Process,
    way: Outside,
    rate: float,
    hunting: "asyncio.Task[None]",
    log: Path,
) -> int:
    """Send readings until the hunt is over, and return how many."""
    send = await asyncio.to_thread(way.connect, process)
    began, number = time.monotonic(), 0
    with suppress(ConnectionError):
        while not hunting.done():
            number += 1
            bits = {f"bit{place}": number >> place & 1 for place in range(BITS)}
            send(bits)
            if process.stdin is not None:
                await process.stdin.drain()
            await asyncio.sleep(began + number / rate - time.monotonic())
    if way.source[0] != "-":
        await _all_taken_in(log)
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)
    if process.stdin is not None:
        process.stdin.close()
    return number


async def _all_taken_in(log: Path) -> None:
    """Wait until nothing more is written: what was sent is under way no longer."""
    size = -1
    files = log.parent.rglob
    while size != (size := sum(path.stat().st_size for path in files("*"))):  # noqa: ASYNC110
        await asyncio.sleep(_STILL)


@contextmanager
def outside(by: str, folder: Path, *of_broker: str) -> Iterator[Outside]:
    """Yield where a run gets its readings, by what `feed` takes; configure a broker."""
    sensors = ("--set", f"sensors={','.join(_NAMES)}")
    if by == "-":
        yield Outside(("-", *sensors), _by_pipe)
    elif by == ROS2:
        at, file = f"tcp/127.0.0.1:{free_port()}", folder / "soak.toml"
        fields = [f"/soak.data[{place}]" for place in range(BITS)]
        file.write_text(
            f'[source]\nkind="ros2"\nrouter="{at}"\nbins=0\nsensors={fields}\n'
        )
        with zenoh.open(configuration("router", listen__endpoints=[at])):
            yield Outside((str(file),), lambda _: _by_ros2(at))
    elif by != "mqtt:":
        at = f"tcp/127.0.0.1:{free_port()}"
        source = ("zenoh:", *sensors, "--listen", at, "--swarm", "soak")
        yield Outside(source, lambda _: _over_zenoh(at, singly=by == SINGLY))
    else:
        with started(folder, "allow_anonymous true", *of_broker) as broker:
            one = '{{name="{0}", topic="soak", field="{0}", on=["1"], off=["0"]}}'
            file = folder / "soak.toml"
            file.write_text(
                f'[source]\nkind="mqtt"\nbroker={{port={broker.port}}}\n'
                f"sensors=[{','.join(map(one.format, _NAMES))}]\n"
                'publish={prefix="said"}\n'
            )
            client, status = Client(CallbackAPIVersion.VERSION2), "said/world/status"
            try:
                yield Outside(
                    (str(file),),
                    lambda _: _by_broker(client, broker.port, "soak", status),
                )
            finally:
                client.disconnect()
                client.loop_stop()


def _by_pipe(process: Process) -> Send:
    """Write lines, each at once: a pipe takes all of it or none."""
    if (pipe := process.stdin) is None:
        raise ValueError("process: must have a pipe to write to")
    pipe.transport.set_write_buffer_limits(0)
    return lambda bits: pipe.write(json.dumps({"bits": bits}).encode() + b"\n")


def _over_zenoh(at: str, *, singly: bool) -> Send:
    """Put each line, or of each the next sensor alone."""
    put, turn = by_zenoh(at, "soak"), cycle(_NAMES)
    if not singly:
        return lambda bits: put({"bits": bits})
    return lambda bits: put({"sensor": (name := next(turn)), "on": bits[name]})


def _by_ros2(at: str) -> Send:
    """Publish an array of numbers, from a node, once a run listens."""
    session = open_session(at)
    node = RosNode(session, "soak")
    listened_to(session, "0/soak/any/any")
    array = node.types[kind := "std_msgs/msg/UInt8MultiArray"]
    layout = node.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    say = node.publisher("/soak", kind, Qos(keep_all=True)).publish
    return lambda bits: say(array(layout, np.array([*bits.values()], np.uint8)))


def _by_broker(client: Client, port: int, topic: str, status: str) -> Send:
    """Publish to a topic, once a run says on another one that it is there."""
    listens = threading.Event()
    client.on_message = lambda *_: listens.set()
    room = threading.Semaphore(_AHEAD)
    client.on_publish = lambda *_: room.release()
    client.connect("127.0.0.1", port)
    client.subscribe(status, qos=1)
    client.loop_start()
    if not listens.wait(PATIENCE):
        raise TimeoutError(f"{status}: the run does not say that it is there")
    return lambda bits: (
        room.acquire(timeout=PATIENCE)
        and client.publish(topic, json.dumps(bits), qos=1)
    )


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
