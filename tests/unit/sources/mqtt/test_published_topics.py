"""The MQTT topics of a run, and how it is announced to Home Assistant."""

import json
import re
from collections.abc import Sequence
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from neurosnap.sources.mqtt.options import MqttPublish
from neurosnap.sources.mqtt.publisher import Topics, discovery, discovery_topic, slugs

NAMES = ["door", "hall/motion", "hall motion"]


@given(names=st.lists(st.text(st.sampled_from("ab_-/ é02"), min_size=1), unique=True))
def test_slugs_are_plain_and_all_different(names: list[str]) -> None:
    made = slugs(names)
    assert len(set(made)) == len(names)
    assert all(re.fullmatch("[A-Za-z0-9_-]+", slug) for slug in made)
    plain = [name for name in names if re.fullmatch("[ab0-9-]+", name)]
    assert slugs(plain) == tuple(plain)


def told(
    publish: MqttPublish, names: Sequence[str] = NAMES, **more: Any
) -> dict[str, Any]:
    """Return what Home Assistant is told of a device."""
    topics = Topics(publish.prefix, names)
    found: dict[str, Any] = json.loads(
        discovery(publish, topics, names, **{"acts": False, **more})
    )
    return found


def test_home_assistant_is_told_of_a_device_with_its_components() -> None:
    publish = MqttPublish(prefix="neurosnap/house", device="House")
    assert discovery_topic(publish) == "homeassistant/device/neurosnap_house/config"
    found = told(publish, acts=True)
    assert found["device"]["identifiers"] == ["neurosnap_house"]
    assert found["device"]["name"] == "House"
    assert found["origin"]["name"] == "neurosnap"
    assert found["origin"]["support_url"].startswith("https://")
    assert found["availability"] == [{"topic": "neurosnap/house/status"}]
    components = found["components"]
    topics = {name: each["state_topic"] for name, each in components.items()}
    assert topics == {
        "sensor_door": "neurosnap/house/sensor/door",
        "sensor_hall_motion": "neurosnap/house/sensor/hall_motion",
        "sensor_hall_motion_2": "neurosnap/house/sensor/hall_motion_2",
        "anomaly": "neurosnap/house/anomaly",
        "decision": "neurosnap/house/decision",
    }
    assert components["sensor_hall_motion"] == {
        "platform": "binary_sensor",
        "name": "hall/motion (believed)",
        "entity_category": "diagnostic",
        "unique_id": "neurosnap_house_sensor_hall_motion",
        "default_entity_id": "binary_sensor.neurosnap_house_sensor_hall_motion",
        "state_topic": "neurosnap/house/sensor/hall_motion",
        "value_template": "{{ 'None' if value == 'unknown' else value }}",
    }
    assert "entity_category" not in components["anomaly"]
    assert len({one["unique_id"] for one in components.values()}) == len(components)


def test_a_device_has_more_where_a_run_does_more() -> None:
    publish = MqttPublish(prefix="n")
    components = told(publish, judges=True)["components"]
    assert "decision" not in components
    problem = {"platform": "binary_sensor", "device_class": "problem"}
    problem |= {"state_topic": "n/health/door"}
    assert problem.items() <= components["health_door"].items()
    assert components["health"]["state_topic"] == "n/health"


ENTITY = re.compile(r"(?!.*__)(binary_sensor|sensor)\.(?!_)[a-z0-9_]+(?<!_)")
"""What Home Assistant takes for an entity's id (`homeassistant.core`)."""


@given(names=st.lists(st.text(st.sampled_from("aB_-/ é02"), min_size=1), unique=True))
@example(names=["Anomaly", "Decision"])
def test_every_entity_has_an_id_that_home_assistant_takes_and_a_name_of_its_own(
    names: list[str],
) -> None:
    found = told(MqttPublish(prefix="Ö/House"), names, acts=True)
    components = found["components"].values()
    for component in components:
        platform, _ = component["default_entity_id"].split(".")
        assert platform == component["platform"]
        assert ENTITY.fullmatch(component["default_entity_id"])
    assert len({component["name"] for component in components}) == len(components)
