"""``neurosnap run`` with readings from a pipe and from a Zenoh program."""

import json
import signal
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
