"""Real ROS 2 (rclpy of Kilted, over Fast DDS) and what is made here without it.

Its wheels stand in an environment of their own, which `make build/ros2/installed`
makes: to import one starts Python anew.
"""

import base64
import json
import os
import signal
import subprocess
import sysconfig
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from neurosnap.recording.replay.verify import verify
from neurosnap.sources.live.journal import journal_of, read_journal
from neurosnap.sources.ros2.diagnostics import ARRAY, STALE, Diagnostics
from neurosnap.sources.ros2.message_types import TypesByHash, stock_types
from tests.support.patience import PATIENCE
from tests.support.sources import readings

ROOT = Path(__file__).parents[2]
THERE = ROOT / "build" / "ros2"
PYTHON = THERE / "bin" / "python"
PROGRAM = ROOT / "tests" / "support" / "real_ros2.py"
pytestmark = [
    pytest.mark.exhaustive,
    pytest.mark.slow,
    pytest.mark.skipif(
        not (THERE / "installed").exists(), reason="needs make build/ros2/installed"
    ),
]
MOMENTS = "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"
KEYED = {
    "diagnostic_msgs/msg/DiagnosticStatus": "name",
    "diagnostic_msgs/msg/KeyValue": "key",
}


def asked(question: Any) -> list[Any]:
    """Return what the program says, a line of JSON each."""
    done = subprocess.run(
        (PYTHON, PROGRAM),
        input=json.dumps(question),
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def messages() -> list[tuple[str, dict[str, str], bytes, Any]]:
    """Some messages of each type: the type, hashes, CDR, and what it says."""
    said = asked(None)
    return [(name, of, base64.b64decode(data), what) for name, of, data, what in said]


def as_we_say(name: str, said: Any) -> Any:
    """Return a message as our decoder has it: no times, statuses by their names."""
    _, members = stock_types().fielddefs[name]
    kinds, found = {member: _inner(what) for member, (_, what) in members}, {}
    for member, value in said.items():
        of, many = kinds[member]
        if of in MOMENTS:
            continue
        if of in stock_types().types:
            value = [as_we_say(of, each) for each in (value if many else [value])]
            if not many:
                (value,) = value
            elif value and (key := KEYED.get(of)):
                value = {each.pop(key): each for each in value}
                if key == "key":
                    value = {k: rest["value"] for k, rest in value.items()}
        found[member] = value
    return found


def _inner(what: Any) -> tuple[str, bool]:
    """Return the type within a description of a field, and whether there are many."""
    if isinstance(what, str):
        return what, False
    first, _ = what
    return (first[1], True) if isinstance(first, tuple) else (first, False)


def same(one: Any, other: Any) -> bool:
    """Compare as text, in which NaN equals itself."""
    one, other = (json.dumps(each, default=np.ndarray.tolist) for each in (one, other))
    return bool(one == other)


def test_the_types_have_the_hashes_of_ours(messages: Any) -> None:
    hashes = {name: each for _, of, *_ in messages for name, each in of.items()}
    assert len(hashes) > 120
    ours = {name: stock_types().hash_rihs01(name) for name in hashes}
    assert ours == hashes


def test_its_messages_say_the_same_to_us(messages: Any) -> None:
    types = TypesByHash()
    for name, hashes, data, said in messages:
        decoder = types.find(name, hashes[name])
        assert decoder is not None, name
        assert same(decoder(data), as_we_say(name, said)), name


def test_what_we_encode_says_the_same_to_it(messages: Any) -> None:
    store, ours = stock_types(), []
    for name, _, data, _ in messages:
        one = store.get_msgdef(name)
        message, _ = one.deserialize_cdr_le(data[4:], 0, one.cls, store)
        again = store.serialize_cdr(message, name)
        ours.append((name, base64.b64encode(again).decode()))
    (heard,) = asked(ours)
    for (name, *_, said), there in zip(messages, heard, strict=True):
        assert same(there, said), name


def test_our_diagnostics_are_ones_to_it() -> None:
    about = Diagnostics(["door", "hall"])
    about.follow(7, [True, None], [True, False])
    data = base64.b64encode(about.message(5_000_000_007)).decode()
    ((heard,),) = asked([(ARRAY, data)])
    assert heard["header"] == {"frame_id": "", "stamp": {"sec": 5, "nanosec": 7}}
    door, hall = heard["status"]
    assert (door["level"], door["name"], door["message"]) == (
        0,
        "neurosnap: door",
        "on",
    )
    assert (hall["level"], hall["hardware_id"]) == (STALE, "hall")
    assert hall["values"][1:3] == [
        {"key": "believed", "value": "off"},
        {"key": "since", "value": "tick 7"},
    ]


class Robot:
    """Programs in the Python that has ROS 2; with the packages of this one, too."""

    def __init__(self, folder: Path, closes: ExitStack) -> None:
        self._folder, self._closes = folder, closes
        self.left = closes.enter_context(ExitStack())
        self._environment = {
            "HOME": str(folder),
            "PATH": os.environ["PATH"],
            "PYTHONPATH": f"{ROOT}:{sysconfig.get_path('purelib')}",
            "NUMBA_DISABLE_JIT": "1",
            "ROS_DOMAIN_ID": "87",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }

    def start(self, *command: object) -> subprocess.Popen[str]:
        with (self._folder / "said").open("a") as said:
            process = subprocess.Popen(
                [PYTHON, *map(str, command)],
                cwd=self._folder,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=said,
                text=True,
                bufsize=1,
            )
        self._closes.enter_context(process)  # a publisher ends with its input
        if command[0] != PROGRAM:
            self._closes.callback(process.kill)
        return process

    def kill(self, process: subprocess.Popen[str]) -> None:
        """Kill a process; in the end remove the shared memory that it leaves behind."""
        for each in psutil.Process(process.pid).memory_maps():
            if each.path.startswith("/dev/shm/fastdds_") and "_port" not in each.path:
                for path in (Path(each.path), Path(f"{each.path}_el")):
                    self.left.callback(path.unlink, missing_ok=True)
        process.kill()
        process.wait()

    def publisher(self, topic: str) -> subprocess.Popen[str]:
        process = self.start(PROGRAM, topic)
        publish(process, on=True)
        return process


def publish(publisher: subprocess.Popen[str], *, on: bool) -> None:
    assert publisher.stdin is not None
    publisher.stdin.write(f"{json.dumps(on)}\n")


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    with ExitStack() as closes:
        yield Robot(tmp_path, closes)


def until(run: subprocess.Popen[str], log: Path, *wanted: bool | None) -> None:
    """Wait until the last tick shows this; the time only catches hangs."""
    end, said = time.monotonic() + PATIENCE, log.with_name("said")
    while True:
        rows = read_journal(journal_of(log)).rows if log.exists() else ()
        if rows and readings(rows[-1].observed(len(wanted))) == [*wanted]:
            return
        with suppress(subprocess.TimeoutExpired):
            run.wait(0.1)
        assert run.poll() is None, said.read_text()
        assert time.monotonic() < end, said.read_text()


@pytest.mark.zenoh
def test_a_run_hears_it_and_knows_who_is_gone(robot: Robot, tmp_path: Path) -> None:
    file, log = tmp_path / "robot.toml", tmp_path / "robot.mcap"
    file.write_text(
        """
[source]
kind = "ros2"
through = "rclpy"
domain = 87
sensors = ["/door.data", "/lamp.data"]
bins = 0
"""
    )
    door, lamp = robot.publisher("/door"), robot.publisher("/lamp")
    run = robot.start("-m", "neurosnap", "run", file, "--cells", "inline", "--out", log)
    until(run, log, True, True)
    publish(door, on=False)
    until(run, log, False, True)
    robot.kill(door)
    until(run, log, None, True)
    publish(lamp, on=False)
    until(run, log, None, False)
    robot.publisher("/door")
    until(run, log, True, False)
    run.send_signal(signal.SIGINT)
    assert run.wait(PATIENCE) == 0, (tmp_path / "said").read_text()
    assert verify(log).same


def test_what_it_publishes_is_discovered(robot: Robot, tmp_path: Path) -> None:
    robot.publisher("/door")
    file, found = tmp_path / "robot.toml", 1
    given = ("--through", "rclpy", "--domain", 87, "--seconds", 1, "--out", file)
    while found:  # until it is there, and says something
        program = robot.start("-m", "neurosnap", "ros2", "discover", *given)
        found = program.wait(PATIENCE)
    assert 'through = "rclpy"\ndomain = 87\n' in file.read_text()
    assert '    "/door.data",  # was true\n' in file.read_text()
