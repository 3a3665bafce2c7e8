from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.records import MAGIC
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import describe as facts_of
from tests.support.recordings import EACH, NOW, delivered, record, traffic
from tools.fuzz import altered_bytes

SECOND = 10**9


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log.mcap"


def write_small(path: Path, metadata: dict[str, str], *, finish: bool = True) -> None:
    """Write 4 s: an observation each second but the third, a pulse, a key-frame."""
    observations = [
        wire.Delivery(
            "observation", n, NOW, wire.encode(wire.Observation(n + 1, b"\1"))
        )
        for n in range(4)
    ]
    (pulse, frame) = delivered([EACH["pulse"], EACH["keyframe"]])
    first, second, _, fourth = observations
    with Writer(path, packs=False) as writer:
        writer.start(metadata)
        for delivery in (first, second, pulse, pulse, fourth):
            after = delivery.sequence if delivery.key == "observation" else 1
            writer.add(delivery, NOW + after * SECOND)
        writer.add(frame, NOW + 4 * SECOND)
        writer.add(frame._replace(key="?"), NOW)
        if finish:
            writer.finish({"ticks": "4"}, {"world": 4, "coordinator": 1})


def shown(path: Path) -> list[str]:
    return list(render(describe(Recording.open(path))))


def test_what_is_missing_comes_first_and_empty_channels_are_left_out(
    path: Path,
) -> None:
    write_small(path, {"seed": "7", "evil\x1b[2J": "\x1b]0;owned\x07"})
    assert shown(path) == [
        "missing: 1",
        "  world  1",
        "duplicates: 1 left out",
        "foreign: 1 left out",
        "run:",
        "  seed           7",
        r"'  evil\x1b[2J'  '\x1b]0;owned\x07'",
        f"  schema         {wire.SCHEMA}",
        "totals:",
        "  ticks  4",
        "messages:  5",
        "duration:  0:00:04",
        "start:     2023-11-14T22:13:20.000+00:00",
        "end:       2023-11-14T22:13:24.000+00:00",
        f"size:      {path.stat().st_size / 1000:.1f} kB in 1 chunks",
        "channels:",
        "  observation  3",
        "  pulse        1",
        "  keyframe     1",
    ]


def test_one_that_was_cut_short_says_where(path: Path) -> None:
    write_small(path, {"seed": "7"}, finish=False)
    info = describe(Recording.open(path))
    assert info.totals is None
    assert (info.messages, info.duration) == (5, 4.0)
    assert info.completeness == Completeness(5, {"world": 1})
    size = path.stat().st_size
    place = f"cut short: after 1 whole chunks, at byte {size} of {size}"
    assert place in render(info)


@pytest.mark.parametrize("finish", [True, False])
def test_frame_and_content_tell_the_same(path: Path, finish: bool) -> None:
    deliveries = traffic(500)
    record(path, deliveries, every=60, finish=finish)
    info = describe(Recording.open(path))
    assert (info.messages, info.chunks) == (500, 9)
    for topic in wire.TOPICS:
        expected = sum(wire.topic(delivery.key) == topic for delivery in deliveries)
        assert info.channels.get(topic, 0) == expected
    assert (info.start, info.end) == (NOW + 1000, NOW + 1499)


def test_an_empty_one_can_be_shown(path: Path) -> None:
    record(path, [])
    assert {"duration:  0:00:00", "missing: 0"} <= set(shown(path))


@pytest.mark.parametrize("channel", [0, 1033])
def test_an_index_of_a_channel_that_is_not_there_is_damage(
    path: Path, channel: int
) -> None:
    record(path, traffic(50))
    records = altered_bytes.records(path.read_bytes()[len(MAGIC) : -len(MAGIC)])
    at = [kind for kind, _ in records].index(Opcode.MESSAGE_INDEX)
    forged = channel.to_bytes(2, "little") + records[at][1][2:]
    records[at] = Opcode.MESSAGE_INDEX, forged
    path.write_bytes(altered_bytes.resealed(records))
    rule = rf"chunk 1: an index must be of a topic, got channel {channel}$"
    with pytest.raises(RecordingError, match=rule):
        describe(Recording.open(path))


@pytest.mark.parametrize(
    ("changes", "threshold", "decay"),
    [
        ({}, "0.01 (the default)", "none"),
        ({"snapshot": "discounted", "decay": 0.5}, "0.000125 (the default)", "0.5"),
    ],
)
def test_values_are_shown_as_they_were_in_force_and_sensors_once(
    path: Path, changes: dict[str, Any], threshold: str, decay: str
) -> None:
    names = tuple(f"sensor{number}" for number in range(200))
    write_small(path, facts_of(RunOptions(source="", body=Body(own=names), **changes)))
    text = "\n".join(shown(path))
    rows = (line.split(maxsplit=1) for line in shown(path) if line.startswith("  "))
    values = {name: rest[0] if rest else "" for name, *rest in rows}
    assert (values["threshold"], values["decay"]) == (threshold, decay)
    assert all(text.count(f'"{name}"') == 1 for name in names)
