"""``neurosnap run`` with readings from a pipe and from a Zenoh program."""

import contextlib
import fcntl
import json
import os
import re
import signal
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import pack
from neurosnap.sources.live.journal import journal_of
from tests.support.command_line import call
from tests.support.commands import Command
from tests.support.patience import PATIENCE

pytestmark = [pytest.mark.slow, pytest.mark.zenoh]


def running(*arguments: str) -> Command:
    return Command("run", *arguments, "--threshold", "0.1")


@pytest.mark.parametrize("cells", ["process", "worker", "inline"])
def test_lines_of_standard_input_are_the_ticks(tmp_path: Path, cells: str) -> None:
    log = tmp_path / "lines.mcap"
    lines = [
        {"bits": {"door": 1, "motion": 0}},
        *({"bits": [number % 2, number % 3 > 0]} for number in range(10)),
        {"sensor": "window", "on": 1},
        {"sensor": "door", "on": None},
    ]
    text = "\n".join(map(json.dumps, lines)) + "\nnonsense\n"
    with running("-", "--cells", cells, "--workers", "1", "--out", str(log)) as process:
        process.stdin.write(text)
        _, errors = process.communicate(PATIENCE)
    assert process.returncode == 3, errors  # a line and a sensor's reading are lost
    assert call("info", log).exit_code == 3
    assert not journal_of(log).exists()
    assert "sensor: must be one the run began with, got 'window'" in errors
    assert "1 more refused, the last: standard input:" in errors  # within a second
    seen = [r.message for r in Recording.open(log).messages(("observation",))]
    assert [(m.bits, m.known) for m in seen if isinstance(m, wire.Observation)] == [
        (pack([True, False]), b""),
        *((pack([number % 2 > 0, number % 3 > 0]), b"") for number in range(10)),
        (pack([False, False]), pack([False, True])),
    ]


def test_ctrl_c_ends_a_run_that_waits_for_input(tmp_path: Path) -> None:
    log = tmp_path / "waits.mcap"
    with running("-", "--set", "sensors=door", "--out", str(log)) as process:
        process.stdin.write('nonsense\n{"bits": [1]}\n')
        process.stdin.flush()
        assert "standard input:1: reading" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)
    assert process.returncode == 3  # the first line


def test_a_terminal_shows_a_run_at_a_glance_below_what_its_parts_say(
    tmp_path: Path,
) -> None:
    log = tmp_path / "seen.mcap"
    keeper, terminal = os.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("4H", 40, 120, 0, 0))
    given = ["run", "-", "--set", "sensors=door,motion", "--out", str(log)]
    seen = b""
    with subprocess.Popen(
        [sys.executable, "-m", "neurosnap", *given],
        env={**os.environ, "TERM": "xterm"},
        stdin=subprocess.PIPE,
        stdout=terminal,
        stderr=terminal,
    ) as process:
        os.close(terminal)
        assert process.stdin is not None
        process.stdin.write(b"nonsense\n" + b'{"bits": [1, 1]}\n{"bits": [0, 0]}\n' * 9)
        process.stdin.flush()
        while b"18 in ticks" not in seen:
            seen += os.read(keeper, 1 << 16)
        process.stdin.close()
        with contextlib.suppress(OSError):  # nothing has it open any more
            while more := os.read(keeper, 1 << 16):
                seen += more
    os.close(keeper)
    assert process.returncode == 3
    text = seen.decode()
    # A part has said it: the rows are taken away before it is printed.
    assert re.search(r"\x1b\[2K\r?standard input:1: reading", text)
    for row in ("cells     2 of 2 alive", "19 received = 18 in ticks + 1 refused"):
        assert row in text
    assert "deepest by height:" in text
    assert text.rindex("\x1b[2K") < text.index("the deepest wave")  # the summary
