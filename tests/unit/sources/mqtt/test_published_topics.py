"""What a run publishes of itself, and how Home Assistant is told of it."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import ShapeError
from neurosnap.sources.mqtt.options import MqttPublish
from neurosnap.sources.mqtt.published_topics import (
    Topics,
    beliefs,
    discovery,
    discovery_topic,
    predictions,
    slugs,
)

NAMES = ["door", "hall/motion", "hall motion"]


@given(
    names=st.lists(st.text(st.sampled_from("ab_-/ é02"), min_size=1), unique=True),
)
def test_slugs_are_plain_and_all_different(names: list[str]) -> None:
    made = slugs(names)
    assert len(set(made)) == len(names)
    assert all(re.fullmatch("[A-Za-z0-9_-]+", slug) for slug in made)


@given(names=st.lists(st.from_regex(r"\A[a-z0-9-]{1,4}\Z"), unique=True))
def test_a_plain_name_is_its_own_slug(names: list[str]) -> None:
    assert slugs(names) == tuple(names)


READINGS = st.lists(
    st.tuples(st.sampled_from([None, True, False]), st.booleans()),
    min_size=3,
    max_size=3,
)


@given(readings=READINGS)
def test_beliefs_and_predictions_follow_from_the_state(
    readings: list[tuple[bool | None, bool]],
) -> None:
    literals = np.array([[on is True, on is False] for on, _ in readings]).reshape(-1)
    known = np.array([read for _, read in readings])
    word = {None: "unknown", True: "ON", False: "OFF"}
    said = [word[on] for on, _ in readings]
    assert [each.decode() for each in beliefs(literals)] == said
    expected = {
        name: word[on]
        for name, (on, read) in zip(NAMES, readings, strict=True)
        if on is not None and not read
    }
    assert json.loads(predictions(NAMES, literals, known)) == expected
    assert predictions(NAMES, literals, None) == b"{}"


def test_what_is_known_must_be_one_a_sensor() -> None:
    with pytest.raises(ShapeError, match=r"^known: must be \(3,\), one a sensor"):
        predictions(NAMES, np.zeros(6, np.bool_), np.ones(2, np.bool_))


def test_home_assistant_is_told_of_a_device_with_its_components() -> None:
    publish = MqttPublish(prefix="neurosnap/house", device="House")
    topics = Topics(publish.prefix, NAMES)
    assert discovery_topic(publish) == "homeassistant/device/neurosnap_house/config"
    told = json.loads(
        discovery(publish, topics, NAMES, acts=True, classes={"hall/motion": "motion"})
    )
    assert told["device"]["identifiers"] == ["neurosnap_house"]
    assert told["device"]["name"] == "House"
    assert "configuration_url" not in told["device"]
    assert told["origin"]["name"] == "neurosnap"
    assert told["origin"]["support_url"].startswith("https://")
    assert told["availability"] == [{"topic": "neurosnap/house/status"}]
    components = told["components"]
    assert set(components) == {
        "sensor_door",
        "sensor_hall_motion",
        "sensor_hall_motion_2",
        "anomaly",
        "predictions",
        "decision",
        "ticks",
        "implications",
        "read",
    }
    assert components["sensor_hall_motion"] == {
        "platform": "binary_sensor",
        "name": "hall/motion (believed)",
        "device_class": "motion",
        "entity_category": "diagnostic",
        "unique_id": "neurosnap_house_sensor_hall_motion",
        "default_entity_id": "binary_sensor.neurosnap_house_sensor_hall_motion",
        "state_topic": "neurosnap/house/sensor/hall_motion",
        "value_template": "{{ 'None' if value == 'unknown' else value }}",
    }
    assert "device_class" not in components["sensor_door"]
    assert "entity_category" not in components["anomaly"]
    ids = [component["unique_id"] for component in components.values()]
    assert len(set(ids)) == len(ids)
    where = {component["state_topic"] for component in components.values()}
    assert where == {
        *topics.sensors,
        topics.anomaly,
        topics.predictions,
        topics.decision,
        topics.progress,
    }


def test_what_decides_nothing_has_no_decisions() -> None:
    publish = MqttPublish()
    told = discovery(publish, Topics(publish.prefix, NAMES), NAMES, acts=False)
    assert "decision" not in json.loads(told)["components"]


ENTITY = re.compile(r"(?!.*__)(binary_sensor|sensor|switch)\.(?!_)[a-z0-9_]+(?<!_)")
"""What Home Assistant takes for an entity's id (`homeassistant.core`)."""


@given(names=st.lists(st.text(st.sampled_from("aB_-/ é02"), min_size=1), unique=True))
def test_every_entity_gets_an_id_that_home_assistant_takes(names: list[str]) -> None:
    publish = MqttPublish(prefix="Ö/House")
    told = json.loads(
        discovery(publish, Topics(publish.prefix, names), names, acts=True, pauses=True)
    )
    for component in told["components"].values():
        platform, _ = component["default_entity_id"].split(".")
        assert platform == component["platform"]
        assert ENTITY.fullmatch(component["default_entity_id"])


def test_the_device_links_to_a_page_where_one_is_named() -> None:
    publish = MqttPublish(page="http://house.lan:8080/neurosnap")
    told = json.loads(discovery(publish, Topics("n", NAMES), NAMES, acts=False))
    assert told["device"]["configuration_url"] == "http://house.lan:8080/neurosnap"


def test_a_switch_pauses_learning_where_that_can_be() -> None:
    publish = MqttPublish(prefix="n")
    topics = Topics("n", NAMES)
    told = json.loads(discovery(publish, topics, NAMES, acts=False, pauses=True))
    switch = told["components"]["learning"]
    assert switch["platform"] == "switch"
    assert switch["entity_category"] == "config"
    assert switch["state_topic"] == "n/learning"
    assert switch["command_topic"] == "n/learning/set"
    assert switch["retain"] is True


def test_each_sensor_has_a_problem_where_its_health_is_followed() -> None:
    topics = Topics("neurosnap", ["hall door"])
    told = json.loads(
        discovery(MqttPublish(), topics, ["hall door"], acts=False, judges=True)
    )
    broken = told["components"]["health_hall_door"]
    assert (broken["platform"], broken["device_class"]) == ("binary_sensor", "problem")
    assert broken["state_topic"] == "neurosnap/health/hall_door"
    assert told["components"]["health"]["state_topic"] == "neurosnap/health"


def test_no_two_entities_have_the_same_name() -> None:
    names = ["Ticks", "Learning", "Implications", "Sensors read", "Anomaly"]
    told = json.loads(
        discovery(MqttPublish(), Topics("n", names), names, acts=True, pauses=True)
    )
    shown = [component["name"] for component in told["components"].values()]
    assert len(set(shown)) == len(shown)
