from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.opcode import Opcode

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import RecordingError
from neurosnap.fabric.protocol import Place
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
    with Writer(path, compression="none") as writer:
        writer.start(metadata)
        for delivery in (
            observations[0],
            observations[1],
            pulse,
            pulse,
            observations[3],
        ):
            second = delivery.sequence if delivery.key == "observation" else 1
            writer.add(delivery, NOW + second * SECOND)
        writer.add(frame, NOW + 4 * SECOND)
        writer.add(frame._replace(key="?"), NOW)
        if finish:
            writer.finish({"ticks": "4"}, {"world": 4, "coordinator": 1})


def test_what_is_missing_comes_first_and_empty_channels_are_left_out(
    path: Path,
) -> None:
    write_small(path, {"seed": "7"})
    text = render(describe(Recording.open(path)))
    lines = text.split("\n")
    assert lines == [
        "missing: 1",
        "\tworld  1",
        "duplicates: 1 left out",
        "foreign: 1 left out",
        "run:",
        "\tseed:    7",
        f"\tschema:  {wire.SCHEMA}",
        "totals:",
        "\tticks:  4",
        "messages:  5",
        "duration:  0:00:04",
        "start:     2023-11-14T22:13:20Z",
        "end:       2023-11-14T22:13:24Z",
        f"size:      {path.stat().st_size / 1024:.2f} KiB in 1 chunks",
        "channels:",
        "\tobservation  3 messages",
        "\tpulse        1 messages",
        "\tkeyframe     1 messages",
    ]


def test_it_says_where_the_parts_of_a_swarm_on_several_machines_were(
    path: Path,
) -> None:
    with Writer(path) as writer:
        writer.start({"seed": "7"})
        writer.write_places(
            {"world": Place("oak.lan", 4711), "cell/0": Place("elm", 2)}
        )
        writer.finish({"ticks": "4"}, {})
    lines = render(describe(Recording.open(path))).split("\n")
    at = lines.index("run:")
    assert lines[at : at + 6] == [
        "run:",
        "\tseed:    7",
        f"\tschema:  {wire.SCHEMA}",
        "places:",
        "\tworld:   oak.lan/4711",
        "\tcell/0:  elm/2",
    ]


def test_one_that_was_cut_short_says_where(path: Path) -> None:
    write_small(path, {"seed": "7"}, finish=False)
    info = describe(Recording.open(path))
    assert info.cut is not None
    assert info.totals is None
    assert (info.messages, info.duration) == (5, 4.0)
    assert info.completeness == Completeness(5, {"world": 1})
    size = path.stat().st_size
    place = f"cut short: after 1 whole chunks, at byte {size} of {size}"
    assert place in render(info).split("\n")


@pytest.mark.parametrize("finish", [True, False])
def test_frame_and_content_tell_the_same(path: Path, finish: bool) -> None:
    deliveries = traffic(500)
    record(path, deliveries, every=60, finish=finish)
    info = describe(Recording.open(path))
    assert info.messages == 500
    assert info.chunks == 9
    for topic in wire.TOPICS:
        expected = sum(wire.topic(delivery.key) == topic for delivery in deliveries)
        assert info.channels.get(topic, 0) == expected
    assert (info.start, info.end) == (NOW + 1000, NOW + 1499)


def test_an_empty_one_can_be_shown(path: Path) -> None:
    record(path, [])
    lines = render(describe(Recording.open(path))).split("\n")
    assert "duration:  0:00:00" in lines
    assert "start:     0.000000000" in lines
    assert "missing: 0" in lines


def test_control_characters_do_not_reach_the_terminal(path: Path) -> None:
    write_small(path, {"evil\x1b[2J": "\x1b]0;owned\x07"})
    text = render(describe(Recording.open(path)))
    assert "\x1b" not in text
    assert r"'evil\x1b[2J':" in text


def test_times_of_other_clocks_are_shown_in_seconds(path: Path) -> None:
    write_small(path, {})
    info = describe(Recording.open(path))
    for start in (1_500_000_000, 10**9 * 10**12):
        shown = render(msgspec.structs.replace(info, start=start, end=start))
        text = f"{start // 10**9}.{start % 10**9:09}"
        assert f"start:     {text}" in shown.split("\n")


@pytest.mark.parametrize("channel", [0, 1033])
def test_an_index_of_a_channel_that_is_not_there_is_damage(
    path: Path, channel: int
) -> None:
    record(path, traffic(50))
    records = altered_bytes.records(path.read_bytes()[len(MAGIC) : -len(MAGIC)])
    at = [kind for kind, _ in records].index(Opcode.CHUNK_INDEX)
    index, before = records[at][1], 36  # where the channels of a chunk start
    forged = index[:before] + channel.to_bytes(2, "little") + index[before + 2 :]
    records[at] = Opcode.CHUNK_INDEX, forged
    path.write_bytes(altered_bytes.resealed(records))
    recording = Recording.open(path)
    assert recording.files[0].layout.sealed
    rule = rf"chunk 1: an index must be of a topic, got channel {channel}$"
    with pytest.raises(RecordingError, match=rule):
        describe(recording)


# What was in force --------------------------------------------------------------------


def shown_of(path: Path, options: RunOptions) -> dict[str, str]:
    """Return what is shown of a run, by name."""
    write_small(path, facts_of(options))
    lines = render(describe(Recording.open(path))).split("\n")
    rows = (line.strip().partition(":") for line in lines if line.startswith("\t"))
    return {name: text.strip() for name, _, text in rows}


@pytest.mark.parametrize(
    ("changes", "threshold", "decay"),
    [
        ({}, "0.01 (the default)", "none"),
        ({"threshold": 0.05}, "0.05", "none"),
        (
            {"snapshot": "discounted"},
            "0.000125 (the default)",
            "0.984375 (the default)",
        ),
        ({"snapshot": "discounted", "decay": 0.5}, "0.000125 (the default)", "0.5"),
    ],
)
def test_values_are_shown_as_they_were_in_force(
    path: Path, changes: dict[str, Any], threshold: str, decay: str
) -> None:
    options = RunOptions(source="a.csv", body=Body(own=("a", "b")), **changes)
    shown = shown_of(path, options)
    assert (shown["threshold"], shown["decay"]) == (threshold, decay)


def test_a_sensor_is_named_once(path: Path) -> None:
    names = [f"sensor{number}" for number in range(200)]
    body = Body(own=tuple(names), orders=(0,) * 200)
    write_small(path, facts_of(RunOptions(source="", body=body)))
    text = render(describe(Recording.open(path)))
    assert all(text.count(f'"{name}"') == 1 for name in names)
    assert "0,0" not in text
