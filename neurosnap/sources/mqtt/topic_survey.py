"""Surveys MQTT topics: what they publish, and which look like binary sensors.

Pure: payloads in, sensors out. A place is a topic whose whole payload is a word or a
number, or a field of a JSON payload. It looks like a sensor where all that it said are
words of one kind, on or off: those of `neurosnap.sources.meaning`, a pair of `PAIRS`,
or true and false in JSON. A number in a field is one only if it was both 0 and 1, and
nothing else: 1 may be a count.

Left out are commands, what bridges and discovery say of themselves, what a run of ours
publishes, and attributes beside a state of Home Assistant's statestream.
"""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import OFF, ON, UNKNOWN
from neurosnap.sources.mqtt.options import MqttSensor
from neurosnap.sources.mqtt.payload import Payload

PAIRS = (
    ("active", "inactive"),
    ("alarm", "normal"),
    ("enabled", "disabled"),
    ("home", "away"),
    ("motion", "no_motion"),
    ("occupied", "unoccupied"),
    ("playing", "paused"),
    ("present", "absent"),
    ("running", "stopped"),
    ("unlocked", "locked"),
    ("wet", "dry"),
)
"""Words for on and off that no sensor knows unless it is told."""
MOST_TOPICS = 10_000
"""Topics that are looked at; what comes of others is counted."""
_MOST_WORDS = 8  # different values of one place; a sensor has a few
_LONGEST = 40  # characters of a value that may be a word
_DEPTH = 3  # levels of a JSON payload
_LONG = 500  # characters of a topic or of the way to a field; names are made of both
_DOMAINS = {
    *("alarm_control_panel", "binary_sensor", "climate", "cover", "device_tracker"),
    *("fan", "input_boolean", "light", "lock", "media_player", "person", "remote"),
    *("sensor", "siren", "switch", "vacuum", "valve"),
}
_LAST_LEVELS = {"set", "get", "config", "cmd", "command", "last_changed"}
_UPDATES = {"update", "update_available"}
_INVERTED = {"contact"}
"""zigbee2mqtt: it is true where something is closed."""
_NO_NAME = re.compile(r"\W+")


class HeardTopic(msgspec.Struct):
    """The messages received on one topic."""

    topic: str
    messages: int = 0
    """How many; what the broker had kept is one of them."""
    kind: str = ""
    """What its payloads are: text, number, JSON, no text; or several of these."""
    values: dict[str, dict[str, None]] = {}
    """By field (empty: the whole payload), the values there, as in JSON, in order."""


class Survey:
    """Collects messages, and reports which topics look like binary sensors."""

    def __init__(self) -> None:
        self._heard: dict[str, HeardTopic] = {}
        self.passed_over = 0
        """Messages of topics beyond `MOST_TOPICS`."""

    def add(self, topic: str, data: bytes) -> bool:
        """Add one message; return whether its topic is a new one. O(its length)."""
        heard = self._heard.get(topic)
        new = heard is None
        if heard is None:
            if len(self._heard) >= MOST_TOPICS:
                self.passed_over += 1
                return False
            heard = self._heard[topic] = HeardTopic(topic)
        heard.messages += 1
        kind, found = _values(Payload(topic, data))
        if kind not in heard.kind.split(", "):
            heard.kind = f"{heard.kind}, {kind}" if heard.kind else kind
        for field, value in found:
            said = heard.values.setdefault(field, {})
            if len(said) <= _MOST_WORDS:  # one more than a sensor may have
                said[value] = None
        return new

    def topics(self) -> list[HeardTopic]:
        """Return what came, by topic."""
        return [self._heard[topic] for topic in sorted(self._heard)]

    def sensors(self) -> list[MqttSensor]:
        """Return a sensor for each place that looks like one, by topic and field."""
        found: list[tuple[tuple[str, ...], MqttSensor]] = []
        for heard in self.topics():
            levels = heard.topic.split("/")
            if self._is_left_out(levels):
                continue
            for field, values in sorted(heard.values.items()):
                sensor = _sensor(heard.topic, field, list(values))
                if sensor is not None:
                    found.append((_name_parts(levels, field), sensor))
        names = _names([parts for parts, _ in found])
        return [
            msgspec.structs.replace(sensor, name=name)
            for name, (_, sensor) in zip(names, found, strict=True)
        ]

    def _is_left_out(self, levels: list[str]) -> bool:
        if sum(map(len, levels)) + len(levels) > _LONG:
            return True
        last, first = levels[-1], levels[0]
        if last in _LAST_LEVELS or first in {"neurosnap", "cmnd"} or "bridge" in levels:
            return True
        # Beside the state of an entity statestream publishes its attributes. The levels
        # end with a domain of Home Assistant, the entity, and a word.
        is_entity = len(levels) >= 3 and levels[-3] in _DOMAINS
        state = "/".join([*levels[:-1], "state"])
        return last != "state" and is_entity and state in self._heard


def _values(payload: Payload) -> tuple[str, list[tuple[str, str]]]:
    """Return what kind of payload it is, and the values in it by their fields."""
    try:
        text = payload.text
    except InvalidValueError:
        return "no text", []
    try:
        document = payload.document
    except InvalidValueError:
        return "text", [("", _as_json(text))]
    if isinstance(document, dict):
        return "JSON", list(_fields(document, "", _DEPTH))
    if isinstance(document, list):
        return "JSON", []
    number = isinstance(document, int | float) and not isinstance(document, bool)
    return "number" if number else "text", [("", _as_json(text))]


def _fields(
    document: dict[str, Any], before: str, depth: int
) -> Iterator[tuple[str, str]]:
    for name, value in document.items():
        if not name or "." in name or name in _UPDATES:
            continue  # no way to a field can say it, or it is no reading
        if len(before) + len(name) > _LONG:
            continue
        if isinstance(value, dict):
            if depth > 1:
                yield from _fields(value, f"{before}{name}.", depth - 1)
        elif not isinstance(value, list):
            yield f"{before}{name}", _as_json(value)


def _as_json(value: object) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= _LONGEST else _as_json("…")


def _sensor(topic: str, field: str, values: list[str]) -> MqttSensor | None:
    """Return a sensor without a name; None if what was said is no sensor's."""
    said = [msgspec.json.decode(value) for value in values]
    words = {
        word
        for value in said
        if (word := _word(value)) not in UNKNOWN  # nor does it say anything
    }
    counts = any(type(value) in {int, float} for value in said)
    if not words or (counts and words != {"0", "1"}):
        return None
    sensor = MqttSensor(name="?", topic=topic, field=field or None)
    inverted = field.rpartition(".")[2] in _INVERTED and words <= {"true", "false"}
    if words <= {*ON, *OFF} and not inverted:
        return sensor
    for on, off in (*PAIRS, ("false", "true")):
        if words <= {on, off}:
            return msgspec.structs.replace(sensor, on=(on,), off=(off,))
    return None


def _word(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case _:
            return str(value).strip().casefold()


def _name_parts(levels: list[str], field: str) -> tuple[str, ...]:
    """Return what a name is made of, from the general to the particular."""
    if levels[-1] == "state" and len(levels) > 1 and not field:
        levels = levels[:-1]
    inner = field.split(".") if field else []
    if inner == ["state"]:
        inner = []
    parts = (_NO_NAME.sub("_", part).strip("_") for part in levels)
    named = [part for part in parts if part]
    # A field alone says too little: the device belongs to it.
    last = "_".join([*named[-1:], *(_NO_NAME.sub("_", part) for part in inner)])
    return (*named[:-1], last or "sensor")


def _names(places: list[tuple[str, ...]]) -> list[str]:
    """Return the last part of each place, or all of them where others have that, too.

    Where two are the same to their beginning, the later ones get a number.
    """
    often = Counter(parts[-1] for parts in places)
    names: list[str] = []
    for parts in places:
        name = found = parts[-1] if often[parts[-1]] == 1 else "_".join(parts)
        number = 2
        while found in names:
            found = f"{name}_{number}"
            number += 1
        names.append(found)
    return names
