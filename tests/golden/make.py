"""Makes what is stored here, where it is to change: ``python -m tests.golden.make``.

The recording is ``recording.mcap``, its meaning beside it as JSON; a change of the
schema replaces the pair. Of every kind of run, `meanings` holds what it comes
to, and `messages` what the coordinator says in it. What differs is replaced and named:
look at it with ``git diff`` before it is committed. `runs` holds recordings of them.
"""

import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.golden.meaning import meaning_of, message_lines
from tests.golden.scenarios import SCENARIOS, made

FOLDER = Path(__file__).parent
BEGIN = 1_700_000_000_000_000_000

MESSAGES: tuple[tuple[int, wire.Message], ...] = (
    (0, wire.Decision(0, 1, "the run opens")),
    (0, wire.Observation(1, b"\x05", True, b"\x05")),
    (1, wire.Wiring(0, 1, 0, (2,), (), (5,), ())),
    (2, wire.Wiring(0, 2, 1, (), (2,), (), (5,))),
    (3, wire.WaveStart(1, 1, "state", 2, 1)),
    (0, wire.Pulse(1, 0, 2, 1, 4, 1)),
    (1, wire.Pulse(1, 0, 5, 1, 4)),
    (0, wire.CellReport(1, 1, 0, (2,), (1,), (4,), 0)),
    (2, wire.CellReport(1, 0, 0, (0, 1), (0, 3), (3, 3), 2, 2)),
    (4, wire.WaveStart(2, 1, "signal", 1, 2, (0, 5), 1, 1, 2)),
    (5, wire.State(1, 1, b"\x15", False, 1, 1, 1, 2, 2)),
    (6, wire.Reached(1, 2, (0, 5), b"\x25", 1, 1, 1, 1)),
    (7, wire.Decision(1, -1, "ünïcode: nothing to do")),
    (8, wire.KeyFrame(1, b"PK not quite a snapshot", 2, (3,))),
    (0, wire.Fault("cell/2", "wiring/0: must hold its own messages")),
    (9, wire.WorkerWiring(1, 3, 2, bytes((0, 0, 0, 0, 2, 0, 0, 0)), b"")),
    (0, wire.PulseBatch(2, 0, 1, 0, bytes(4), b"\2\0\0\0", b"\1\0\0\0", b"\4\0\0\0")),
    (0, wire.WorkerReport(2, 1, 0, b"\2\0\0\0", b"\1\0\0\0", (2, 4), 0, 3)),
    (
        10,
        wire.Anomaly(
            1, 1, (1,), (0, 1), True, 1, (0,), (0,), (2,), (7.0,), (0.5,), (1,)
        ),
    ),
    (
        11,
        wire.Recall(
            *(1, 2, 1, (4, 1), b"\1\1", bytes(8), (1, 1), 2),
            *(b"\1", b"", 0.75, 0.125, 1),
        ),
    ),
    (3, wire.Recalled("cell/1", 1, 2, (), b"\1", bytes(4), bytes(32), b"\3")),
    (12, wire.Reminder("cell/1", 1, 64, (1,), b"", b"\1")),
    (13, wire.Band("coordinator", 1, "joints", 2, memoryview(b"\1\2\3\4"))),
    (14, wire.Learn(1, b"\x05", b"\x05", False, 1, b"PK", (0,), (2,))),
    (
        1,
        wire.Learned(
            *(0, 1, 1, 1, 2, bytes((0, 0, 0, 0)), b"\1", b"\2\0\0\0", bytes(4)),
            *(b"\3", (0,), (2.5,), (1.0,), (1,)),
        ),
    ),
    (1, wire.Image(1, wire.Timestamp(1_700_000_000, 7), "world", b"\x89PNG", "png")),
    # The world's number 2 is lost, and number 3 is its last word.
    (3, wire.Leave("world")),
)
"""Each with the running number of its sender."""


def meaning(recording: Recording) -> dict[str, Any]:
    """Return what is in a recording, as JSON-able objects."""
    return {
        "metadata": recording.metadata,
        "totals": recording.totals,
        "completeness": recording.completeness(),
        "messages": [
            {
                "topic": wire.topic(recorded.message.key),
                "sender": recorded.message.sender,
                "sequence": recorded.sequence,
                "sent": recorded.sent,
                "log_time": recorded.log_time,
                "message": recorded.message,
            }
            for recorded in recording.messages()
        ],
    }


def make(folder: Path = FOLDER) -> Path:
    """Write the pair for the schema in force."""
    path = folder / "recording.mcap"
    with Writer(path) as writer:
        writer.start({"seed": "7", "world": "Golden-v0", "sensors": '["a","b","c"]'})
        for number, (sequence, message) in enumerate(MESSAGES):
            sent = BEGIN + number * 1_000_000
            delivery = wire.Delivery(message.key, sequence, sent, wire.encode(message))
            writer.add(delivery, sent + 250_000)
            if number == 7:
                writer.flush()
        writer.finish({"ticks": "1"}, {"world": 4, "coordinator": 15})
    text = msgspec.json.format(msgspec.json.encode(meaning(Recording.open(path))))
    path.with_suffix(".json").write_bytes(text + b"\n")
    return path


def stored(what: str, name: str) -> Path:
    """Return where `meanings` or `messages` of a scenario are stored."""
    return FOLDER / what / f"{name}.txt"


def make_scenarios() -> None:
    """Make all scenarios; store what they come to, and name what is new."""
    shutil.rmtree(FOLDER / "runs", ignore_errors=True)
    for scenario in SCENARIOS:
        with tempfile.TemporaryDirectory() as folder:
            lives = made(scenario, Path(folder) / f"{scenario.name}.mcap")
            if scenario.stored:
                shutil.copytree(folder, FOLDER / "runs", dirs_exist_ok=True)
        if not scenario.like:
            _store(stored("meanings", scenario.name), meaning_of(scenario, lives))
        _store(stored("messages", scenario.name), message_lines(lives))


def _store(path: Path, lines: Iterable[str]) -> None:
    text = "\n".join(lines) + "\n"
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        sys.stdout.write(f"{path.parent.name}/{path.name} is new\n")
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    (FOLDER / "recording.mcap").unlink()
    make()
    make_scenarios()
