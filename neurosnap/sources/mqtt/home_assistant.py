"""Home Assistant discovery messages, so that a run shows up as a device.

One retained message a device, in the form of 2024.11 and later: the device, who says
so, and its components under ids of their own. Whether the device is there follows from
the run's status topic and its last will. An empty message takes the device away.

References:
    https://www.home-assistant.io/integrations/mqtt/#device-discovery-payload
"""

from collections.abc import Sequence
from typing import Any

import msgspec

from neurosnap.sources.mqtt.options import MqttPublish
from neurosnap.sources.mqtt.published_topics import Topics, slugs
from neurosnap.system.distribution import version

# What is no reading is the payload None to Home Assistant.
_BELIEF = "{{ 'None' if value == 'unknown' else value }}"


def discovery_topic(publish: MqttPublish) -> str:
    """Return where the device is announced."""
    return f"{publish.discovery_prefix}/device/{node(publish)}/config"


def node(publish: MqttPublish) -> str:
    """Return the device's id: two runs with the same prefix are the same device."""
    return slugs([publish.prefix])[0]


def discovery(
    publish: MqttPublish, topics: Topics, names: Sequence[str], *, acts: bool
) -> bytes:
    """Return the announcement.

    A sensor that a later run does not have must be taken away by hand there, or by a
    run with `MqttPublish.forget`.

    Args:
        publish: The device's name and id.
        topics: Where its components' states are.
        names: The sensors' names, as shown to people.
        acts: Whether it decides anything.
    """
    unique = node(publish)
    components: dict[str, dict[str, Any]] = {
        f"sensor_{slug}": {
            "platform": "binary_sensor",
            "name": name,
            "state_topic": topic,
            "value_template": _BELIEF,
        }
        for slug, name, topic in zip(topics.slugs, names, topics.sensors, strict=True)
    }
    components["anomaly"] = {
        "platform": "binary_sensor",
        "device_class": "problem",
        "name": "Anomaly",
        "state_topic": topics.anomaly,
        "value_template": "{{ value_json.now }}",
        "json_attributes_topic": topics.anomaly,
        "json_attributes_template": "{{ value_json.last | tojson }}",
    }
    components["predictions"] = {
        "platform": "sensor",
        "name": "Predictions",
        "icon": "mdi:crystal-ball",
        "state_topic": topics.predictions,
        "value_template": "{{ value_json | count }}",
        "json_attributes_topic": topics.predictions,
    }
    if acts:
        components["decision"] = {
            "platform": "sensor",
            "name": "Decision",
            "icon": "mdi:source-branch",
            "state_topic": topics.decision,
            "value_template": "{{ value_json.action }}",
            "json_attributes_topic": topics.decision,
        }
    for identity, component in components.items():
        component["unique_id"] = f"{unique}_{identity}"
    return msgspec.json.encode(
        {
            "device": {
                "identifiers": [unique],
                "name": publish.device,
                "manufacturer": "neurosnap",
                "model": "Universal Memory Architecture",
                "sw_version": version(),
            },
            "origin": {"name": "neurosnap", "sw_version": version()},
            "availability": [{"topic": topics.status}],
            "qos": 1,
            "components": components,
        }
    )
