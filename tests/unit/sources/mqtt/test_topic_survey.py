"""Surveys topics and proposes sensors for them."""

import json
import tomllib

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.cli import init
from neurosnap.apps.config.sources import MqttTable
from neurosnap.sources.mqtt import topic_survey
from neurosnap.sources.mqtt.options import MqttBroker, MqttSensor
from neurosnap.sources.mqtt.payload import Payload, PayloadReader
from neurosnap.sources.mqtt.topic_survey import Survey


def survey(*messages: tuple[str, object]) -> Survey:
    found = Survey()
    for topic, said in messages:
        text = said if isinstance(said, str | bytes) else json.dumps(said)
        found.add(topic, text if isinstance(text, bytes) else text.encode())
    return found


def read(sensor: MqttSensor, said: object) -> bool | None:
    text = said if isinstance(said, str) else json.dumps(said)
    return PayloadReader(sensor).read(Payload(sensor.topic, text.encode()))


@pytest.mark.parametrize(
    ("off", "on"),
    [
        *(("OFF", "ON"), ("false", "true"), ("0", "1"), ("closed", "open")),
        *(("locked", "unlocked"), ("not_home", "home"), ("away", "home")),
    ],
)
def test_words_for_on_and_off_are_a_sensor(off: str, on: str) -> None:
    (sensor,) = survey(("a/x", off), ("a/x", on), ("a/x", "unavailable")).sensors()
    assert (sensor.name, sensor.topic, sensor.field) == ("x", "a/x", None)
    assert (read(sensor, off), read(sensor, on)) == (False, True)


@pytest.mark.parametrize(
    "said",
    [
        *(["21.5"], ["0", "1", "2"], ["cloudy"], ["on", "cloudy"], ["unavailable"]),
        *([""], [b"\xff"], ['"on"'], ["on" * 40], ["[true]"], [{"battery": 1}]),
        [{"count": 0}, {"count": 1}, {"count": 2}],
        [{"a.b": True, "": True, "update": {"installed": True}}],
        ["[" * 2000],
    ],
)
def test_anything_else_is_none(said: list[object]) -> None:
    found = survey(*(("a/x", each) for each in said))
    assert found.sensors() == []
    assert [heard.messages for heard in found.topics()] == [len(said)]


def test_the_devices_of_zigbee2mqtt_are_sensors() -> None:
    door = {"contact": False, "battery": 100, "linkquality": 1, "battery_low": False}
    hall = {"occupancy": True, "illuminance": 0, "update": {"state": "idle"}}
    sensors = survey(
        ("zigbee2mqtt/Front door", door),
        ("zigbee2mqtt/hall", hall),
        ("zigbee2mqtt/hall/availability", {"state": "online"}),
        ("zigbee2mqtt/lamp", {"state": "ON", "brightness": 254}),
        ("zigbee2mqtt/lamp/set", {"state": "ON"}),
        ("zigbee2mqtt/bridge/state", {"state": "online"}),
    ).sensors()
    assert {sensor.name: sensor.field for sensor in sensors} == {
        "Front_door_battery_low": "battery_low",
        "Front_door_contact": "contact",
        "hall_occupancy": "occupancy",
        "availability": "state",
        "lamp": "state",
    }
    contact = next(sensor for sensor in sensors if sensor.field == "contact")
    assert read(contact, door) is True  # no contact: it is open


def test_the_states_of_statestream_are_sensors_and_their_attributes_are_not() -> None:
    sensors = survey(
        ("homeassistant/binary_sensor/front_door/state", "off"),
        ("homeassistant/binary_sensor/front_door/device_class", '"door"'),
        ("homeassistant/binary_sensor/front_door/restored", "true"),
        ("homeassistant/switch/kettle/state", "on"),
        ("homeassistant/person/ann/state", "not_home"),
        ("homeassistant/person/ann/editable", "true"),
        ("homeassistant/sensor/outside/state", "7.5"),
        ("homeassistant/device/neurosnap/config", {"device": {"on": True}}),
        ("neurosnap/sensor/door", "ON"),
    ).sensors()
    assert {sensor.name for sensor in sensors} == {"front_door", "ann", "kettle"}


def test_names_are_long_where_they_must_be() -> None:
    names = {
        "home/kitchen/motion": "home_kitchen_motion",
        "home/bath/motion": "home_bath_motion",
        "home/door": "door",
        "x/a b": "x_a_b",
        "x/a/b": "b",
        "x/a_b": "x_a_b_2",
        "/": "sensor",
    }
    sensors = survey(*((topic, "ON") for topic in names)).sensors()
    assert {sensor.topic: sensor.name for sensor in sensors} == names


def test_a_program_is_told_of_topics_and_sensors() -> None:
    door = ("house/door", {"contact": True, "battery": 9})
    assert init._facts(survey(door, door, ("warm", "7"))) == {
        "topics": [
            {"topic": "house/door", "messages": 2, "kind": "JSON"},
            {"topic": "warm", "messages": 1, "kind": "number"},
        ],
        "sensors": [
            {"name": "door_contact", "topic": "house/door", "field": "contact"}
        ],
        "passed_over": 0,
    }


def test_topics_without_end_are_counted_and_no_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(topic_survey, "MOST_TOPICS", 2)
    found = survey(("a", "ON"), ("b", "ON"), ("c", "ON"), ("a", "OFF"))
    assert [heard.topic for heard in found.topics()] == ["a", "b"]
    assert found.passed_over == 1


WORDS = st.sampled_from(["ON", "OFF", "open", "1", "locked", "21.5", "", "é\n", "null"])
FIELDS = st.dictionaries(
    st.text(st.sampled_from('ab."é \x7f'), max_size=3),
    st.one_of(WORDS, st.booleans(), st.none(), st.integers(0, 2)),
    max_size=3,
)
TOPICS = st.text(st.sampled_from('ab/"\\é\x7f $😀'), min_size=1, max_size=6)


@given(st.lists(st.tuples(TOPICS, st.one_of(WORDS, FIELDS)), max_size=8))
def test_whatever_is_said_the_sensors_read_it_and_the_file_has_them(
    messages: list[tuple[str, object]],
) -> None:
    found = survey(*messages)
    sensors = found.sensors()
    for sensor in sensors:
        mine = [said for topic, said in messages if topic == sensor.topic]
        field = sensor.field
        has = [s for s in mine if field is None or (isinstance(s, dict) and field in s)]
        assert has
        for said in has:
            if field is None and isinstance(said, dict):
                continue  # a topic that says text as well as JSON
            read(sensor, said)
    if sensors:
        broker = MqttBroker(host="broker.example", username='a"b')
        text = init.mqtt_file(
            broker, sensors, {each.name: "\x7f\n" for each in sensors}
        )
        table = msgspec.convert(tomllib.loads(text)["source"], MqttTable)
        assert (table.sensors, table.broker) == (tuple(sensors), broker)
