"""Measures runs that are fed from outside, each as its user starts it.

This process sends at a steady pace, stamps each reading, and looks at the memory of the
run's parts. A reading's latency ends when the recorder has the state of the first tick
that was made of it: readings come in the order in which they are sent, and each
observation says how many had been received.
"""

import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from array import array
from collections.abc import Mapping
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import IO, Any

import numpy as np
import psutil
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from tests.support.senders import Send
from tools.bench.report import Line, Sizes
from tools.soak.memory import Gauge, resident
from tools.soak.outside import BITS, ROS2, SINGLY, outside

_RATE = 2000  # readings a second
_LOOKS = 100  # at the memory, at most
_QUIET = 5.0  # seconds until what was sent last has come in
_END = 600.0  # seconds in which a run makes its last ticks
_LEAK = 0.02  # of its memory that a part may gain in the second half


def _fed(by: str, sizes: Sizes) -> list[Line]:
    """Feed a run in one way, and judge it."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        log, told = Path(folder, "field.mcap"), list[bytes]()
        with outside(by, log.parent) as (source, connect):
            command = ["run", *source, "--out", str(log), "--format", "json"]
            run: Any = subprocess.Popen(
                [sys.executable, "-m", "neurosnap", *command],
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            with run:
                reading = threading.Thread(target=lambda: told.extend(run.stdout))
                reading.start()
                try:
                    send = _lines(run.stdin) if source[0] == "-" else connect(run)
                    count = int(_RATE * sizes.field)
                    stamps, gauge = _sent(send, count, run.pid, by in ("-", SINGLY))
                    if source[0] != "-":
                        time.sleep(_QUIET)
                        run.send_signal(signal.SIGINT)
                    run.stdin.close()
                    reading.join(_END)
                finally:
                    run.kill()
        waits = latencies(np.array(stamps), log)
        return [_line(by, stamps, json.loads(told[-1]), waits, gauge)]


def _lines(pipe: IO[bytes]) -> Send:
    """Return what writes the reading of one sensor after another."""
    turn = cycle(f"bit{place}" for place in range(BITS))

    def write(bits: Mapping[str, object]) -> object:
        line = {"sensor": (name := next(turn)), "on": bits[name]}
        return pipe.write(json.dumps(line).encode() + b"\n")

    return write


def _sent(
    send: Send, count: int, pid: int, singly: bool
) -> "tuple[array[float], Gauge]":
    """Send so many; return when each was sent, and the memory meanwhile."""
    stamps, gauge, over = array("d"), Gauge(0), threading.Event()

    def look() -> None:
        is_last = False
        while not is_last:
            is_last = over.wait(max(0.5, count / _RATE / _LOOKS))
            gauge.samples.append((len(stamps), resident(psutil.Process(pid))))

    looking = threading.Thread(target=look)
    looking.start()
    began = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, began + number / _RATE - time.monotonic()))
        turn = number // BITS if singly else number
        bits = {f"bit{place}": turn >> place & 1 for place in range(BITS)}
        stamps.append(time.time())
        send(bits)
    over.set()
    looking.join()
    gauge.tick = count
    del gauge.samples[: len(gauge.samples) // 2]  # then all is full that is bounded
    return stamps, gauge


def latencies(stamps: NDArray[np.float64], log: Path) -> NDArray[np.float64]:
    """Return the seconds from each reading, if it is in a tick, to its state.

    What was sent before there was a first state had to wait for the run to begin, and
    counts only if nothing else was sent.
    """
    received, states = dict[int, int](), dict[int, float]()
    topics = "observation", "state"
    for message, _, _, _, logged in Recording.open(log).messages(topics):
        if isinstance(message, wire.Observation):
            received[message.tick] = message.received.total
        elif isinstance(message, wire.State):
            states[message.tick] = logged / 1e9
    ticks = sorted(states)
    totals, ends = ([of[tick] for tick in ticks] for of in (received, states))
    first = np.searchsorted(totals, np.arange(1, len(stamps) + 1))
    there = first < len(ticks)
    after = there & (stamps > ends[0])
    there = after if after.any() else there
    return np.array(ends)[first[there]] - stamps[there]


def _line(
    by: str,
    stamps: "array[float]",
    facts: dict[str, Any],
    waits: NDArray[np.float64],
    gauge: Gauge,
) -> Line:
    """Judge a run by its own count, the latencies and its memory."""
    counts, sent = facts["readings"], len(stamps)
    pace, memory = (sent - 1) / (stamps[-1] - stamps[0]), gauge.memory()
    half, most = (1e3 * np.percentile(waits, (50, 99))).tolist()
    gains = {who: held.end / held.begin - 1 for who, held in memory.items()}
    held = (f"{who} {memory[who].end >> 20} MB {gains[who]:+.1%}" for who in gains)
    said = " + ".join(f"{count:,} {fate}" for fate, count in counts.items() if count)
    lost = sent - counts["shown"] - counts["after"]
    figures = {f"{who}_gain": gain for who, gain in gains.items()}
    figures |= {"p50": half, "p99": most, "lost": lost, "ticks": facts["ticks"]}
    return Line(
        f"{sent:,} readings, {by} at {pace:,.0f} a second",
        f"{said}; p50 {half:.0f} ms, p99 {most:.0f} ms; {facts['ticks']:,} ticks",
        ", ".join(held),
        f"none lost, memory ≤ +{_LEAK:.0%} in the second half",
        not lost and max(gains.values()) <= _LEAK,
        figures | {"unsaid": sent - sum(counts.values())},
    )


mqtt, stdin, zenoh, ros2 = (partial(_fed, by) for by in ("mqtt:", "-", SINGLY, ROS2))
