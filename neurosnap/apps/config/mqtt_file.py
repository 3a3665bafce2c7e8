"""Writes a TOML file that runs on the topics of a broker."""

from collections.abc import Mapping, Sequence

import msgspec

from neurosnap.sources.mqtt.options import MqttBroker, MqttSensor

_BEGIN = """\
# What `neurosnap init topics` found at {address}. Delete what is of no use, name the rest as
# you like, and then: neurosnap run THIS_FILE

[source]
kind = "mqtt"
#stale_after = 3600          # seconds; a sensor that is silent for longer is unknown

[source.broker]
{broker}

[source.tick]                # a tick whenever a reading has changed, or
min_interval = 0.5           # seconds
max_interval = 60.0
{sensors}
[source.publish]             # beliefs, anomalies; Home Assistant sees them
prefix = "neurosnap"

[supervision]
restart = "always"
"""


def mqtt_file(
    broker: MqttBroker, sensors: Sequence[MqttSensor], said: Mapping[str, str]
) -> str:
    """Return the text of a file that describes a run on `sensors`.

    Args:
        broker: Where they are.
        sensors: One at least.
        said: What was heard of each, by its name, for a comment.
    """
    tables = "".join(
        f"\n[[source.sensors]]  # {_plain(said[sensor.name])}\n{_keys(sensor)}\n"
        for sensor in sensors
    )
    return _BEGIN.format(address=broker.address, broker=_keys(broker), sensors=tables)


def _keys(table: msgspec.Struct) -> str:
    """Return a line for each key that is not what it would be anyway."""
    lines = []
    for field in msgspec.structs.fields(table):
        value = getattr(table, field.name)
        if value != field.default or field.name == "host":
            lines.append(f"{field.name} = {_value(value)}")
    return "\n".join(lines)


def _value(value: object) -> str:
    # JSON's texts, numbers, lists and booleans are TOML's, but for one character.
    return msgspec.json.encode(value).decode().replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)
