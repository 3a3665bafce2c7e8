"""Measures Zenoh alone on this machine, for comparison.

A program of its own, so that its fork server has nothing loaded but Zenoh and what
comes with Python, and its processes hold nothing else. Prints one JSON object.

- ``spawn N``: N processes, each with a session and one subscriber; `--memory` measures
  them once all are up.
- ``ring N LAPS``: a message goes round N processes, each callback puts it on to the
  next through a declared publisher: no queue, no decoding, no report.

What only one process needs is imported there, and the others stay without it.
"""

import argparse
import ctypes
import itertools
import json
import multiprocessing
import resource
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

import zenoh

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerProcess

context = multiprocessing.get_context("forkserver")
BLOCK = zenoh.CongestionControl.BLOCK
WARMUP = 5  # laps, and ticks, not counted
_PATIENCE = 60.0
_PAYLOAD = b"x" * 64  # about what a pulse takes


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(prog="bare")
    parser.add_argument("what", choices=("spawn", "ring"))
    parser.add_argument("count", type=int)
    parser.add_argument("laps", type=int, nargs="?", default=50)
    parser.add_argument("--memory", action="store_true")
    given = parser.parse_args()
    with hub_for(given.count, "tools.bench.bare") as (config, began):
        if given.what == "spawn":
            measured = measure_spawn(config, given.count, began, given.memory)
        else:
            measured = measure_ring(config, given.count, given.laps)
    print(json.dumps(measured))


@contextmanager
def hub_for(count: int, module: str) -> Iterator[tuple[str, float]]:
    """Run a hub; yield how `count` sessions connect to it, and when it was started.

    Args:
        count: How many there will be.
        module: What the processes have loaded, and nothing else.
    """
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    context.set_forkserver_preload([module])
    start(time.sleep, 0).join()  # the fork server's imports are not what is measured
    # Only now, and only here: the fork server has forked with nothing of ours loaded.
    from neurosnap.fabric.hub_address import HubAddress
    from neurosnap.fabric.zenoh.connect_session import connecting
    from neurosnap.fabric.zenoh.hub import open_hub

    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        endpoint = f"unixsock-stream/{folder}/hub"
        config = str(connecting(HubAddress(endpoint), _PATIENCE))
        began = time.perf_counter()
        with open_hub([endpoint], count):
            yield config, began


def measure_spawn(
    config: str, count: int, began: float, memory: bool
) -> dict[str, float]:
    """Return the seconds from the start of the hub until `count` processes are up."""
    up, say_up = context.Pipe(duplex=False)
    processes = [start(be_bare, config, i, say_up) for i in range(count)]
    await_words(up, count)
    measured = {"seconds": time.perf_counter() - began}
    if memory:
        measured["pss"] = mean_pss([process.pid or 0 for process in processes])
    return measured


def measure_ring(config: str, count: int, laps: int) -> dict[str, float]:
    """Return the median seconds a hop of `laps` laps round `count` processes."""
    up, say_up = context.Pipe(duplex=False)
    line, line_end = context.Pipe()
    for number in range(count):
        end = line_end if number == 0 else None
        start(be_relay, config, number, count, laps, say_up, end)
    await_words(up, count)
    line.send_bytes(b"go")
    took = json.loads(await_words(line, 1))
    return {"hop": statistics.median(took) / count}


def mean_pss(pids: list[int]) -> float:
    """Return the mean PSS of processes, in bytes: shared pages in equal shares."""
    import psutil

    return statistics.fmean(psutil.Process(pid).memory_full_info().pss for pid in pids)


def start(work: Callable[..., None], *arguments: object) -> "ForkServerProcess":
    """Start a process that does `work`, and that ends with this one."""
    process = context.Process(target=work, args=arguments, daemon=True)
    process.start()
    return process


def await_words(line: Connection, count: int) -> bytes:
    """Wait for `count` words on `line` and return the last; raise when none comes."""
    word = b""
    for _ in range(count):
        if not line.poll(_PATIENCE):
            raise TimeoutError(f"bare: must be heard of within {_PATIENCE:g} s")
        word = line.recv_bytes()
    return word


def await_listener(publisher: zenoh.Publisher) -> None:
    """Wait until it has a subscriber: before, what is put is dropped in silence."""
    # Its stub says bool, and it is an object that has one.
    while not getattr(publisher.matching_status, "matching", False):
        time.sleep(0.005)


def be_bare(config: str, number: int, say_up: Connection) -> None:
    """Open a session, declare one subscriber, stay."""
    session = join(config)
    callback = zenoh.handlers.Callback(_ignore, indirect=False)
    subscriber = session.declare_subscriber(f"bare/*/{number}", callback)
    say_up.send_bytes(b"1")
    signal.pause()
    subscriber.undeclare()


def be_relay(
    config: str,
    number: int,
    count: int,
    laps: int,
    say_up: Connection,
    line: Connection | None,
) -> None:
    """Put on to the next whatever comes; the first process times the laps."""
    session = join(config)
    onward = session.declare_publisher(
        f"ring/{(number + 1) % count}", congestion_control=BLOCK
    )
    times: list[float] = []

    def relay(sample: zenoh.Sample) -> None:
        onward.put(sample.payload)

    def count_lap(sample: zenoh.Sample) -> None:
        times.append(time.perf_counter())
        if len(times) <= WARMUP + laps:
            onward.put(sample.payload)
        elif line is not None:
            took = [b - a for a, b in itertools.pairwise(times)]
            line.send_bytes(json.dumps(took[WARMUP:]).encode())

    work = relay if line is None else count_lap
    callback = zenoh.handlers.Callback(work, indirect=False)
    session.declare_subscriber(f"ring/{number}", callback)
    await_listener(onward)
    say_up.send_bytes(b"1")
    if line is not None:
        line.recv_bytes()
        onward.put(_PAYLOAD)
    signal.pause()


def _ignore(sample: zenoh.Sample) -> None:
    """Take in nothing."""


def join(config: str) -> zenoh.Session:
    """Return a session; the process gets a SIGTERM when the fork server goes."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)
    return zenoh.open(zenoh.Config.from_json5(config))


def listen(
    session: zenoh.Session, take: Callable[[str, bytes], None], *keys: str
) -> None:
    """Hand what comes under `keys` to `take`, on Zenoh's thread."""

    def hand_over(sample: zenoh.Sample) -> None:
        take(str(sample.key_expr), sample.payload.to_bytes())

    callback = zenoh.handlers.Callback(hand_over, indirect=False)
    for key in keys:
        session.declare_subscriber(key, callback)
