"""What viewers get: read back by the library, taken apart by the viewers' rules."""

import json
from collections.abc import Collection
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from mcap.reader import make_reader

from neurosnap import wire
from neurosnap.apps.export import foxglove_recording, foxglove_schemas
from neurosnap.apps.export.foxglove_recording import write_drawable
from neurosnap.apps.export.foxglove_scene import order_scene
from neurosnap.apps.export.foxglove_writer import COPIED
from neurosnap.apps.export.log_lines import line_of
from neurosnap.errors import RecordingError
from neurosnap.protocol.anomaly_messages import with_support
from neurosnap.recording.format.records import PROFILE
from neurosnap.recording.read.learned_at import snapshot_at
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.run_facts import options_of
from neurosnap.recording.write import rotation
from neurosnap.recording.write.writer import Writer
from neurosnap.sensorium import Sensorium, unpack
from tests.support.export_runs import TICKS, recorded
from tests.support.foxglove_rules import refusals
from tests.support.mcap_contents import said, schemas_in


def test_viewers_take_every_schema_of_a_recording_and_of_what_is_drawn(
    log: Path, drawn: Path
) -> None:
    for path in (log, drawn):
        for topic, schema in schemas_in(path).items():
            assert refusals(schema, topic) == []


@pytest.mark.parametrize(
    "broken",
    [
        {"$ref": "#/$defs/Pulse"},
        {"type": "array", "items": {"type": "integer"}},
        {"type": "object"},
        {"type": "object", "properties": {"a": {"anyOf": [{"type": "null"}]}}},
        {"type": "object", "properties": {"a": {"type": "null"}}},
        {"type": "object", "properties": {"a": {"enum": ["x"]}}},
        {
            "type": "object",
            "properties": {"a": {"type": "string", "oneOf": [{"const": "x"}]}},
        },
        {
            "type": "object",
            "properties": {"a": {"type": "array", "items": {"type": "array"}}},
        },
    ],
)
def test_the_rules_above_refuse_what_viewers_do(broken: dict[str, Any]) -> None:
    assert len(refusals(broken)) == 1


def test_foxgloves_own_text_leaves_types_unsaid() -> None:
    file = Path(foxglove_recording.__file__).parent / "foxglove" / "Log.json"
    assert refusals(json.loads(file.read_text())) == ["root.level: type None"]


def test_a_sensors_numbers_have_names() -> None:
    (rule,) = json.loads(foxglove_schemas.signs(["door"]))["properties"].values()
    names = {choice["title"]: choice["const"] for choice in rule["oneOf"]}
    assert names == {"on": 1, "off": 0, "unknown": foxglove_schemas.UNKNOWN}


def test_messages_are_what_their_schemas_say(drawn: Path) -> None:
    for topic, schema in schemas_in(drawn).items():
        check = Draft202012Validator(schema)
        for _, message in said(drawn, topic):
            assert [error.message for error in check.iter_errors(message)] == []


def test_what_is_copied_is_what_was_recorded(log: Path, drawn: Path) -> None:
    def payloads(path: Path) -> list[tuple[str, int, int, int, bytes]]:
        topics = [f"/{topic}" for topic in COPIED]
        with path.open("rb") as file:
            return [
                (c.topic, m.sequence, m.log_time, m.publish_time, m.data)
                for _, c, m in make_reader(file).iter_messages(topics=topics)
            ]

    assert len(payloads(log)) > 3 * TICKS
    assert payloads(drawn) == payloads(log)


def test_a_sensor_is_a_number_of_its_own(log: Path, drawn: Path) -> None:
    names = options_of(Recording.open(log)).sensors
    read, believed = said(drawn, "/readings"), said(drawn, "/believed")
    unknown = 0
    for topic, signs in (("observe", read), ("state", believed)):
        messages = [each.message for each in Recording.open(log).messages((topic,))]
        assert len(signs) == len(messages) == TICKS
        for (_, sign), message in zip(signs, messages, strict=True):
            assert list(sign) == list(names)
            if isinstance(message, wire.Observation):
                bits = unpack(message.bits, len(names))
                known = unpack(message.known or message.bits, len(names))
                sure = known if message.known else np.ones(len(names), np.bool_)
                expected = [
                    int(b) if k else -1 for b, k in zip(bits, sure, strict=True)
                ]
            else:
                assert isinstance(message, wire.State)
                on = unpack(message.literals, 2 * len(names))
                expected = [
                    1 if on[k] else 0 if on[k + 1] else -1 for k in range(0, len(on), 2)
                ]
            assert list(sign.values()) == expected
            unknown += expected.count(-1)
    assert unknown > 0


def test_the_order_drawn_last_is_the_one_that_was_learned(
    log: Path, drawn: Path
) -> None:
    _, snapshot = snapshot_at(Recording.open(log))
    graph = snapshot.poc_graph()
    _, scene = said(drawn, "/graph")[-1]
    (entity,) = scene["entities"]
    assert [text["text"] for text in entity["texts"]] == [
        snapshot.sensorium.name(a) for a in range(len(graph))
    ]
    pairs = np.argwhere(graph.hasse())
    # What is equivalent is wired both ways and drawn once.
    same = graph.representative[pairs[:, 0]] == graph.representative[pairs[:, 1]]
    lines = len(pairs) - int(same.sum()) // 2
    assert sum(len(line["points"]) for line in entity["lines"]) == 2 * lines > 0


def test_the_order_is_drawn_where_it_changed_and_the_state_always(
    log: Path, drawn: Path
) -> None:
    recording = Recording.open(log)
    wires = [
        snapshot_at(recording, tick)[1].poc_graph().wires("hasse").tobytes()
        for tick in range(1, TICKS + 1)
    ]
    wires.insert(0, snapshot_at(recording, 0)[1].poc_graph().wires("hasse").tobytes())
    changes = 1 + sum(a != b for a, b in pairwise(wires))
    assert len(said(drawn, "/graph")) == changes > 3
    assert len(said(drawn, "/graph/state")) == 1 + TICKS


def test_whoever_opens_it_sees_the_literals_at_once(log: Path, drawn: Path) -> None:
    (begins, order), (same, state) = (
        said(drawn, topic)[0] for topic in ("/graph", "/graph/state")
    )
    first = min(each.log_time for each in Recording.open(log).messages(COPIED))
    assert begins == same == first
    sensorium = Sensorium(options_of(Recording.open(log)).sensors)
    texts, balls = order["entities"][0]["texts"], state["entities"][0]["spheres"]
    assert [text["text"] for text in texts] == [
        sensorium.name(a) for a in range(2 * len(sensorium))
    ]
    # Nothing is known of any of them yet.
    assert len(balls) == len(texts)
    assert len({json.dumps(ball["color"]) for ball in balls}) == 1


def test_scenes_keep_their_distance(log: Path, tmp_path: Path) -> None:
    path = tmp_path / "drawn.mcap"
    write_drawable(path, Recording.open(log))
    times = [time for time, _ in said(path, "/graph/state")]
    last = [time for time, _ in said(path, "/state")][-1]
    assert times[-1] == last
    assert all(b - a >= 10**8 for a, b in pairwise(times[:-1]))


def test_balls_are_coloured_by_the_state(log: Path, drawn: Path) -> None:
    states = [each.message for each in Recording.open(log).messages(("state",))]
    scenes = said(drawn, "/graph/state")[1:]
    for (_, scene), state in zip(scenes, states, strict=True):
        assert isinstance(state, wire.State)
        count = len(scene["entities"][0]["spheres"])
        literals = unpack(state.literals, count)
        looks = [json.dumps(ball["color"]) for ball in scene["entities"][0]["spheres"]]
        for a in range(count):
            for b in range(count):
                alike = (literals[a], literals[a ^ 1]) == (literals[b], literals[b ^ 1])
                assert (looks[a] == looks[b]) == alike


def test_the_log_has_what_went_wrong_and_who_left(log: Path, drawn: Path) -> None:
    lines = [line for _, line in said(drawn, "/log")]
    left = [line["name"] for line in lines if line["message"] == "left"]
    gone = [each.message for each in Recording.open(log).messages(("leave",))]
    assert left == [message.who for message in gone if isinstance(message, wire.Leave)]
    doubts = [each.message for each in Recording.open(log).messages(("anomaly",))]
    grounded = [m for m in doubts if isinstance(m, wire.Anomaly) and with_support(m, 1)]
    warned = [line for line in lines if line["level"] == 3]
    assert 0 < len(warned) == len(grounded) < len(doubts)
    assert all("may be wrong" in line["message"] for line in warned)


def test_the_log_says_where_a_run_was_taken_up_again(log: Path, tmp_path: Path) -> None:
    old, path = Recording.open(log), tmp_path / "log.mcap"
    with Writer(path) as writer:
        writer.start({**old.metadata, "resumed": "[6, 20]"})
        for each in old.messages():
            writer.put(each.message, each.delivery, each.log_time)
        writer.finish({}, {})
    write_drawable(tmp_path / "drawn.mcap", Recording.open(path))
    lines = said(tmp_path / "drawn.mcap", "/log")
    told = {
        line["message"]: time for time, line in lines if "goes on" in line["message"]
    }
    times = {
        each.message.tick: each.log_time
        for each in old.messages(("observe",))
        if isinstance(each.message, wire.Observation)
    }
    assert told == {
        "goes on after tick 6": times[7],
        "goes on after tick 20": times[21],
    }


def test_a_fault_is_an_error_of_whoever_met_it(tmp_path: Path) -> None:
    line = line_of(wire.Fault("cell/3", "what was wrong"), (), 2 * 10**9 + 5)
    assert line is not None
    assert (line["name"], line["message"], line["level"]) == (
        "cell/3",
        "what was wrong",
        4,
    )
    assert line["timestamp"] == {"sec": 2, "nsec": 5}
    Draft202012Validator(
        json.loads(foxglove_schemas.foxglove(foxglove_schemas.LOG))
    ).validate(line)


def without(log: Path, path: Path, tick: int, topics: Collection[str]) -> Path:
    """Copy a recording, but for what is said of a tick on some topics."""
    old = Recording.open(log)
    with Writer(path) as writer:
        writer.start(old.metadata)
        for each in old.messages():
            message = each.message
            if getattr(message, "tick", 0) != tick or message.key not in topics:
                writer.put(message, each.delivery, each.log_time)
        writer.finish({}, {})
    return path


def test_what_is_of_other_sensors_is_an_error(log: Path, tmp_path: Path) -> None:
    old = Recording.open(log)
    foreign: dict[str, wire.Message] = {
        "state": wire.State(TICKS + 1, 99, b"\x01", False, 1, 1, 1, 1, 1),
        "observe": wire.Observation(TICKS + 1, b"\x01\x02\x03\x04"),
        "anomaly": wire.Anomaly(
            TICKS + 1, 1, (99,), (99,), True, 0, (), (), (), (), (), ()
        ),
    }
    for name, message in foreign.items():
        path = tmp_path / f"{name}.mcap"
        with Writer(path) as writer:
            writer.start(old.metadata)
            delivery = wire.Delivery(message.key, 0, 1, wire.encode(message))
            writer.put(message, delivery, 1)
            writer.finish({}, {})
        with pytest.raises(RecordingError, match=rf"{name}\.mcap: .* must be"):
            write_drawable(tmp_path / "out", Recording.open(path))


@pytest.mark.parametrize("topics", [("observe",), ("observe", "state", "decide")])
def test_behind_a_missing_observation_no_order_is_drawn_up_to_the_next_key_frame(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, topics: tuple[str, ...]
) -> None:
    monkeypatch.setattr(foxglove_recording, "_EVERY", 0)
    path = tmp_path / "drawn.mcap"
    lacking = without(log, tmp_path / "log.mcap", 9, topics)
    write_drawable(path, Recording.open(lacking))
    assert len(said(path, "/graph/state")) == 1 + 8 + (TICKS - 10)
    errors = [line["message"] for _, line in said(path, "/log") if line["level"] == 4]
    assert len(errors) == 1
    assert errors[0].startswith("the observation of tick 9 is missing")


def test_nothing_is_told_of_before_the_recording_began(
    log: Path, tmp_path: Path
) -> None:
    path = tmp_path / "drawn.mcap"
    lacking = without(log, tmp_path / "log.mcap", 1, ("observe", "state"))
    write_drawable(path, Recording.open(lacking))
    first = min(time for time, _ in said(path, "/decide"))
    lost = [
        time for time, line in said(path, "/log") if "is missing" in line["message"]
    ]
    assert len(lost) == 1
    assert lost[0] >= first


def test_a_later_file_is_drawn_from_its_key_frame_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rotation, "split_of", lambda _: rotation.Split(1))
    split = recorded(tmp_path / "log.mcap")
    recording = Recording.open(part_paths(split)[1])
    assert recording.begins > 0
    count = write_drawable(tmp_path / "drawn.mcap", recording)
    time, scene = said(tmp_path / "drawn.mcap", "/graph")[-1]
    _, snapshot = snapshot_at(Recording.open(split), recording.begins + count)
    assert scene == order_scene(snapshot.poc_graph(), snapshot.sensorium, time)


def test_a_run_in_several_files_is_drawn_as_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rotation, "split_of", lambda _: rotation.Split(1))
    split, path = recorded(tmp_path / "log.mcap"), tmp_path / "drawn.mcap"
    assert len(part_paths(split)) > 1
    whole = Recording.open(split)
    assert write_drawable(path, whole) == TICKS
    states = [message["tick"] for _, message in said(path, "/state")]
    assert states == list(range(1, TICKS + 1))
    assert len(said(path, "/readings")) == len(said(path, "/believed")) == TICKS
    time, scene = said(path, "/graph")[-1]
    _, snapshot = snapshot_at(whole)
    assert scene == order_scene(snapshot.poc_graph(), snapshot.sensorium, time)


def test_what_is_drawn_is_no_recording(drawn: Path) -> None:
    with pytest.raises(RecordingError, match=f"profile: must be '{PROFILE}', got ''"):
        Recording.open(drawn)
