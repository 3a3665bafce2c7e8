"""A child's reports reach its parent complete, and the child ends with its server."""

import multiprocessing
import subprocess
import sys
import threading
from multiprocessing.connection import Connection

import msgspec
import pytest

from neurosnap.runtime.parts.job import Advanced, Done, Failed, Reporter, decode_report


class Line(Connection):
    """A line that is in the midst of one report until it is let go on."""

    def __init__(self) -> None:
        self.said: list[bytes] = []
        self.busy = threading.Event()
        self.go_on = threading.Event()

    def __del__(self) -> None:
        """There is nothing to close."""

    def send_bytes(self, buf: object, *_: object, **__: object) -> None:
        assert isinstance(buf, bytes)
        assert not self.busy.is_set(), "a report came into the midst of another"
        if b"Done" in buf:
            self.busy.set()
            assert self.go_on.wait(5)
            self.busy.clear()
        self.said.append(buf)


def test_reports_of_two_threads_come_one_after_the_other() -> None:
    line = Line()
    reporter = Reporter("coordinator", line)
    last = threading.Thread(target=reporter.done, args=(["much"],))
    last.start()
    assert line.busy.wait(5)
    between = threading.Thread(target=reporter.progress, args=(3,))
    between.start()
    between.join(0.05)
    line.go_on.set()
    for thread in (last, between):
        thread.join()
    done, progress = (
        msgspec.json.decode(one, type=Done | Advanced) for one in line.said
    )
    assert (type(done), type(progress)) == (Done, Advanced)


@pytest.mark.parametrize(
    "text",
    [
        "short",
        "a" * 10_000,
        "ä" * 5000,
        "\N{SNAKE}" * 4000,
        "\x01\n" * 3000,
        '"' * 4000,
    ],
    ids=["short", "ascii", "two bytes", "four bytes", "six for one", "two for one"],
)
def test_a_reason_is_short_enough_to_share_a_line(text: str) -> None:
    reading, writing = multiprocessing.Pipe(duplex=False)
    with reading, writing:
        Reporter("cell/3", writing).failed(text, died=True)
        whole = reading.recv_bytes()
        assert len(whole) + 4 <= 4096  # what a pipe takes in one piece
        writing.send_bytes(whole)
        report = decode_report(reading.recv_bytes())
    assert isinstance(report, Failed)
    assert (report.who, report.died) == ("cell/3", True)
    assert text.endswith(report.what)
    assert report.what == text or len(whole) > 3600


ORPHAN = """
import os
from neurosnap.runtime import child_processes

if os.fork():
    os._exit(0)
server = child_processes._LOADED_BY
while os.getppid() == server:  # it lives for a moment still
    os.sched_yield()
child_processes._end_with_server()
os.write(1, b"goes on")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells children")
@pytest.mark.slow
def test_a_child_whose_server_died_before_it_could_ask_ends_at_once() -> None:
    command = [sys.executable, "-c", ORPHAN]
    ended = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    assert ended.stdout == b""
