"""Publishes a run's state over MQTT, and announces it to Home Assistant.

That is beliefs, decisions, anomalies and the health of sensors.

Only changes are published, each retained: a program that comes later gets the latest,
and a broker that was restarted is told again. An orderly end says ``offline`` and
leaves the rest, so that Home Assistant keeps the device with its history.

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

import asyncio
import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm import Standing
from neurosnap.sensorium import unpack
from neurosnap.sources.mqtt.connection import MqttLink
from neurosnap.sources.mqtt.options import MqttBroker, MqttPublish
from neurosnap.system.distribution import HOME, version

ON, OFF = b"ON", b"OFF"
WORDS = (b"unknown", ON, OFF)
_ON = {True: ON.decode(), False: OFF.decode()}


class MqttPublisher:
    """Publishes one run.

    Its methods but `serve` may be called from any thread, one at a time, before `serve`
    as well; they do not wait.

    Args:
        broker: Where to.
        publish: Under which topics.
        sensors: The names of all sensors of the run, contextual ones included.
        own: How many of them, from the first on, are published; None if all are.
        actions: The names of the actions, one of which is taken at each step; none:
            nothing is decided.
        judges: Whether the health of its sensors is followed.

    Raises:
        InvalidValueError: The certificates to trust cannot be read, or the password.
    """

    def __init__(
        self,
        broker: MqttBroker,
        publish: MqttPublish,
        sensors: Sequence[str],
        *,
        own: int | None = None,
        actions: Sequence[str] = (),
        judges: bool = False,
    ) -> None:
        self._count = len(sensors)
        self._names = tuple(sensors)[:own]
        self._actions = tuple(actions)
        self._topics = Topics(publish.prefix, self._names)
        self._last: Mapping[str, object] | None = None
        self._beliefs: list[bytes | None] = [None] * len(self._names)
        self._alarms: list[str | None] = [None] * len(self._names)
        self._link = MqttLink(broker, "outlet", status=self._topics.status)
        if publish.discovery:
            found = discovery(
                publish,
                self._topics,
                self._names,
                acts=bool(actions),
                judges=judges,
            )
            self._link.hold(discovery_topic(publish), found)
        if judges:
            for topic in self._topics.health:
                self._hold_json(topic, now=_ON[False], last="")
        self.anomaly(None)

    def observation(self, _: wire.Observation) -> None:
        """Publish nothing of what is read: the broker has it already."""

    def state(self, state: wire.State) -> None:
        """Publish what is believed by a state that the coordinator published. O(N).

        Raises:
            ShapeError: It is the state of another number of sensors.
        """
        literals = unpack(state.literals, 2 * self._count)[: 2 * len(self._names)]
        believed = beliefs(literals)
        for topic, belief, last in zip(
            self._topics.sensors, believed, self._beliefs, strict=True
        ):
            if belief != last:  # few are, and each is a lock to take
                self._link.hold(topic, belief)
        self._beliefs = [*believed]

    def decision(self, decision_: wire.Decision) -> None:
        """Publish a decision; one that is none, where nothing is decided, is left out.

        Raises:
            InvalidValueError: There is no such choice.
        """
        choice, count = decision_.action, len(self._actions)
        if not self._actions or choice < 0:
            return
        if choice >= count:
            rule = f"must be a whole number in 0..{count - 1}"
            raise InvalidValueError("action", rule, choice)
        action = self._actions[choice]
        self._hold_json(self._topics.decision, action=action, why=decision_.why)

    def anomaly(self, record: Mapping[str, object] | None) -> None:
        """Publish that there is an anomaly now, or that there is none.

        `record` is what JSON can hold; if None, the last one stays to be looked at.
        """
        if record is not None:
            self._last = record
        now = _ON[record is not None]
        self._hold_json(self._topics.anomaly, now=now, last=self._last or {})

    def health(self, standing: Standing) -> None:
        """Publish how the sensors are; beside the others, by one thread at a time."""
        alarms = {alarm.sensor: alarm.line() for alarm in standing.alarms}
        for place, name in enumerate(self._names):
            alarm = alarms.get(name)
            if alarm != self._alarms[place]:
                last = alarm or self._alarms[place] or ""
                self._alarms[place] = alarm
                now = _ON[alarm is not None]
                self._hold_json(self._topics.health[place], now=now, last=last)
        progress = standing.progress
        self._hold_json(
            self._topics.known,
            changes=progress.activations,
            of_about=progress.of_about,
            known=progress.known,
            of=progress.sensors,
        )

    def _hold_json(self, topic: str, **said: object) -> None:
        """Let `topic` say a JSON object from now on."""
        self._link.hold(topic, msgspec.json.encode(said))

    async def serve(self, stop: asyncio.Event) -> None:
        """Publish until `stop` is set.

        Raises:
            InvalidValueError: As `MqttLink.serve`, at the start only.
            NeurosnapError: As `MqttLink.serve`, at the start only.
        """
        await self._link.serve(stop)


_OTHER = re.compile(r"[^A-Za-z0-9_-]+")


class Topics:
    """The topics of one run, below a prefix, by the names of its sensors."""

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
    """Return the belief about every sensor in a coherent state, ``(2N,)``.

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
