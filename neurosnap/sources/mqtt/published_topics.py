"""The topics that a run publishes, and how Home Assistant shows it as a device.

Below the prefix, everything retained:

========================  ==========================================================
``status``                ``online`` or ``offline``
``world/status``          the same, of who reads the sensors
``sensor/<slug>``         what is believed of the sensor: ``ON``, ``OFF``, ``unknown``
``decision``              ``{"action": "push", "why": "..."}``
``anomaly``               ``{"now": "ON", "last": {...}}``: whether there is one, and
                          the latest
``health/<slug>``         ``{"now": "ON", "last": "hall: silent since ..."}``:
                          whether the sensor seems broken, and its latest alarm
``health``                ``{"changes": 89, "of_about": 300, "known": 9, "of":
                          14}``: how much is known of the sensors' habits
========================  ==========================================================

Nothing holds the tick, so that what stays the same need not be published again.

Home Assistant discovers the device by one retained message, in the form of 2024.11 and
later: the device, who says so, and its components under ids of their own. Whether the
device is there follows from the run's status topic and its last will. An empty message
takes the device away. What is believed of a sensor is another entity than the sensor
itself, which Home Assistant may well have: its name and its id say so, and like
everything but anomalies it is a diagnosis, which is not put on a dashboard unasked.

References:
    https://www.home-assistant.io/integrations/mqtt/#device-discovery-payload
    https://www.home-assistant.io/integrations/binary_sensor.mqtt/
"""

import re
from collections.abc import Sequence
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.sources.mqtt.options import MqttPublish
from neurosnap.system.distribution import HOME, version

_OTHER = re.compile(r"[^A-Za-z0-9_-]+")

ON, OFF = b"ON", b"OFF"
WORDS = (b"unknown", ON, OFF)


class Topics:
    """The topics of one run.

    Args:
        prefix: What they start with.
        sensors: The sensors' names.
    """

    def __init__(self, prefix: str, sensors: Sequence[str]) -> None:
        self.status = f"{prefix}/status"
        self.world = f"{prefix}/world/status"
        self.decision = f"{prefix}/decision"
        self.anomaly = f"{prefix}/anomaly"
        self.slugs = slugs(sensors)
        """The sensors' names, in order, as they stand in topics."""
        self.sensors = tuple(f"{prefix}/sensor/{slug}" for slug in self.slugs)
        """What each sensor's topic is."""
        self.known = f"{prefix}/health"
        self.health = tuple(f"{prefix}/health/{slug}" for slug in self.slugs)
        """The topic of each sensor's health."""


def slugs(names: Sequence[str]) -> tuple[str, ...]:
    """Return names fit for topics and for Home Assistant's ids, all different.

    Letters, digits, ``_`` and ``-`` stay, anything else becomes ``_``; where that makes
    two the same, or nothing is left of one, its place is added.

    Examples:
        >>> slugs(["door", "hall/door", "hall door", "é"])
        ('door', 'hall_door', 'hall_door_2', '_3')
    """
    taken: set[str] = set()
    given: list[str] = []
    for place, name in enumerate(names):
        slug = _OTHER.sub("_", name)
        if slug in taken or slug == "_":
            slug = f"{slug.rstrip('_')}_{place}"
        while slug in taken:  # a name that looks like one made here
            slug += "_"
        taken.add(slug)
        given.append(slug)
    return tuple(given)


def beliefs(literals: NDArray[np.bool_]) -> list[bytes]:
    """Return what a state says of every sensor.

    Args:
        literals: ``(2N,)``, coherent.

    Returns:
        One of `WORDS` a sensor; unknown where neither of its literals is in the state.
    """
    which = literals[0::2] + 2 * literals[1::2]
    return [WORDS[each] for each in which.tolist()]


Components: TypeAlias = dict[str, dict[str, Any]]
"""By id, what each is."""

# What is no reading is the payload None to Home Assistant.
_BELIEF = "{{ 'None' if value == 'unknown' else value }}"

_DIAGNOSIS = "diagnostic"
_NOT_IN_ID = re.compile(r"[^a-z0-9]+")


def discovery_topic(publish: MqttPublish) -> str:
    """Return where the device is announced."""
    return f"{publish.discovery_prefix}/device/{node(publish)}/config"


def node(publish: MqttPublish) -> str:
    """Return the device's id: two runs with the same prefix are the same device."""
    return slugs([publish.prefix])[0]


def discovery(
    publish: MqttPublish,
    topics: Topics,
    names: Sequence[str],
    *,
    acts: bool,
    judges: bool = False,
) -> bytes:
    """Return the announcement.

    A sensor that a later run does not have must be taken away by hand there.

    Args:
        publish: The device's name and id.
        topics: Where its components' states are.
        names: The sensors' names, as shown to people.
        acts: Whether it decides anything.
        judges: Whether the health of its sensors is followed.
    """
    unique = node(publish)
    components = _beliefs(topics, names)
    if judges:
        components |= _health(topics, names)
    if acts:
        template = "{{ value_json.action }}"
        components["decision"] = _diagnosis(
            "Decision", "source-branch", topics.decision, template
        ) | {"json_attributes_topic": topics.decision}
    for identity, component in components.items():
        component["unique_id"] = f"{unique}_{identity}"
        entity = _entity_id(unique, identity)
        component["default_entity_id"] = f"{component['platform']}.{entity}"
    device = {
        "identifiers": [unique],
        "name": publish.device,
        "manufacturer": "neurosnap",
        "model": "Universal Memory Architecture",
        "sw_version": version(),
    }
    announced = {
        "device": device,
        "origin": {"name": "neurosnap", "sw_version": version(), "support_url": HOME},
        "availability": [{"topic": topics.status}],
        "qos": 1,
        "components": components,
    }
    return msgspec.json.encode(announced)


def _beliefs(topics: Topics, names: Sequence[str]) -> Components:
    """Return the components that say what is believed, and the anomaly."""
    components: Components = {}
    for slug, name, topic in zip(topics.slugs, names, topics.sensors, strict=True):
        components[f"sensor_{slug}"] = {
            "platform": "binary_sensor",
            "name": f"{name} (believed)",
            "entity_category": _DIAGNOSIS,
            "state_topic": topic,
            "value_template": _BELIEF,
        }
    last = "{{ value_json.last | tojson }}"
    components["anomaly"] = _problem("Anomaly", topics.anomaly, last)
    return components


def _health(topics: Topics, names: Sequence[str]) -> Components:
    """Return the components that say which sensors seem broken."""
    components: Components = {}
    last = "{{ {'alarm': value_json.last} | tojson }}"
    for slug, name, topic in zip(topics.slugs, names, topics.health, strict=True):
        problem = _problem(f"{name} (sensor)", topic, last)
        components[f"health_{slug}"] = problem | {"entity_category": _DIAGNOSIS}
    components["health"] = _diagnosis(
        "Sensors known", "heart-pulse", topics.known, "{{ value_json.known }}"
    ) | {"state_class": "measurement", "json_attributes_topic": topics.known}
    return components


def _diagnosis(name: str, icon: str, topic: str, template: str) -> dict[str, Any]:
    """Return a component that says something of the run."""
    return {
        "platform": "sensor",
        "name": name,
        "entity_category": _DIAGNOSIS,
        "icon": f"mdi:{icon}",
        "state_topic": topic,
        "value_template": template,
    }


def _problem(name: str, topic: str, attributes: str) -> dict[str, Any]:
    """Return a component that is on while something is wrong."""
    return {
        "platform": "binary_sensor",
        "device_class": "problem",
        "name": name,
        "state_topic": topic,
        "value_template": "{{ value_json.now }}",
        "json_attributes_topic": topic,
        "json_attributes_template": attributes,
    }


def _entity_id(unique: str, identity: str) -> str:
    """Return an entity's id without its platform, which can be no other device's.

    Such an id has small letters, digits, and single ``_`` between them. Where two come
    out the same, Home Assistant numbers them.
    """
    return _NOT_IN_ID.sub("_", f"{unique}_{identity}".lower()).strip("_")
