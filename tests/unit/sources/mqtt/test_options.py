"""A table of options is checked as a whole, and holds no secret."""

import re
from pathlib import Path

import msgspec
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.tick_schedule import Clocked, OnChange
from neurosnap.sources.mqtt.options import MqttBroker, MqttOptions, MqttTick, is_topic

TABLE = """
kind = "mqtt"
stale_after = 60

[broker]
host = "broker.example"
tls = true
username = "neuro"
password_env = "HOUSE_PASSWORD"

[[sensors]]
name = "door"
topic = "house/door"

[[sensors]]
name = "warm"
topic = "house/climate"
field = "temperature"
when = "> 21.5, off < 21"

[[sensors]]
name = "phone"
topic = "wifi/phone"
when = "heard within 30 s"

[[actions]]
name = "light"
topic = "house/light/set"

[tick]
interval = 5

[publish]
prefix = "neurosnap/house"
"""


HEARD = 'when = "heard within 30 s"'


def parsed(text: str) -> MqttOptions:
    return msgspec.toml.decode(text, type=MqttOptions)


def test_a_table_becomes_options_and_survives_the_recording() -> None:
    options = parsed(TABLE)
    assert [sensor.name for sensor in options.sensors] == ["door", "warm", "phone"]
    assert options.action_names == ("none", "light")
    assert options.broker.address == "broker.example:8883"
    again = msgspec.json.decode(msgspec.json.encode(options), type=MqttOptions)
    assert again == options


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('"house/door"', '"house/+/door"', "door: topic: must be a topic, without"),
        ('"house/light/set"', '"house/+/set"', "light: topic: must be a topic, with"),
        ("off < 21", "off < 22", "warm: when: must let the sensor be off below where"),
        ("> 21.5, ", "t > 21.5, ", 'warm: when: must be like "> 21", "> 21 °C, off'),
        (HEARD, f'{HEARD}\nfield = "a"', "phone: field: must not go with heard"),
        (HEARD, 'when = "heard within 1e999 s"', "phone: when: must be a time"),
        (HEARD, 'when = "heard within 0 s"', "phone: when: must be within more"),
        (HEARD, 'on = ["Yes"]\noff = ["yes"]', "phone: off: must differ"),
        ('name = "light"', 'name = "none"', "names: must be unique"),
        ('name = "warm"', 'name = "door"', "names: must be unique"),
        ("tls = true", 'ca_file = "ca.pem"', "ca_file: must go with tls"),
        ('username = "neuro"', "", "username: must go with a password"),
        ("tls = true", 'password_file = "p"', "password_env: must not go with passwo"),
        ("tls = true", 'password = "1234"', "unknown field `password`"),
        ('"broker.example"', '"a..b"', "host: must be a name or an address, got 'a..b"),
        ('"neurosnap/house"', '"neurosnap/#"', "prefix: must be a topic, without"),
    ],
)
def test_what_breaks_a_rule_is_named(old: str, new: str, text: str) -> None:
    assert TABLE.count(old) == 1
    with pytest.raises(msgspec.ValidationError, match=re.escape(text)):
        parsed(TABLE.replace(old, new))


def test_what_is_no_topic() -> None:
    for topic in ("", "a/\0", "x" * 65536, "a/+/b", "a/#"):
        assert not is_topic(topic)


def test_a_password_comes_from_a_file_or_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "password"
    place.write_text("hunter 2 \nsomething else\n")
    broker = MqttBroker(username="u", password_file=str(place))
    assert broker.password() == "hunter 2 "  # the first line
    assert "hunter" not in repr(broker)
    monkeypatch.setenv("HOUSE_PASSWORD", "hunter2")
    broker = MqttBroker(username="u", password_env="HOUSE_PASSWORD")
    assert broker.password() == "hunter2"
    assert MqttBroker().password() is None


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (None, "must be a file that can be read (No such file or directory)"),
        (b"\n1234\n", "must hold the password in its first line"),
        (b"geheim\xff", "must be a file that can be read (no UTF-8 text)"),
    ],
)
def test_a_place_without_a_password_is_named_but_not_quoted(
    tmp_path: Path, content: bytes | None, rule: str
) -> None:
    place = tmp_path / "password"
    if content is not None:
        place.write_bytes(content)
    text = f"password_file: {rule}, got {str(place)!r}"
    with pytest.raises(InvalidValueError, match=f"^{re.escape(text)}$"):
        MqttBroker(username="u", password_file=str(place)).password()
    with pytest.raises(InvalidValueError, match=r"^password_env: must be set in the e"):
        MqttBroker(username="u", password_env="NOT_SET_ANYWHERE").password()


def test_a_default_pace_goes_with_an_interval() -> None:
    written = msgspec.json.encode(MqttTick(interval=2))  # as in a recording
    assert isinstance(msgspec.json.decode(written, type=MqttTick).schedule(), Clocked)
    assert isinstance(MqttTick().schedule(), OnChange)
