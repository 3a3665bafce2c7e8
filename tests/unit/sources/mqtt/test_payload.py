"""MQTT payloads become readings, checked against separate rules."""

import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import OFF, ON
from neurosnap.sources.mqtt.options import MqttSensor
from neurosnap.sources.mqtt.payload import LARGEST, Payload, PayloadReader


def read(sensor: MqttSensor, data: bytes) -> bool | None:
    return PayloadReader(sensor).read(Payload("house/door", data))


WORDS = MqttSensor(name="door", topic="house/door")
SEEN = MqttSensor(name="phone", topic="wifi/phone", when="heard within 30 s")
CLIMATE = MqttSensor(name="warm", topic="house", field="rooms.0.warm", when="> 20")
OTHERS = MqttSensor(name="x", topic="x", on=("Full",), off=("Empty",))
INSIDE = MqttSensor(name="x", topic="x", field="a.b")


def inside(value: object) -> bytes:
    return json.dumps({"a": {"b": value}, "battery": 3}).encode()


@pytest.mark.parametrize(
    ("sensor", "data", "reading"),
    [
        *((WORDS, f"  {word.upper()}\r\n".encode(), True) for word in ON),
        *((WORDS, f"\t{word.title()} ".encode(), False) for word in OFF),
        *(
            (WORDS, data, None)
            for data in (b"", b" ", b"None", b"null", b"unavailable")
        ),
        (OTHERS, b"full", True),
        (OTHERS, b"EMPTY", False),
        *((INSIDE, inside(value), True) for value in (True, 1, "ON")),
        *((INSIDE, inside(value), False) for value in (False, 0.0)),
        (INSIDE, inside(None), None),
        *(
            (CLIMATE, json.dumps({"rooms": [{"warm": value}]}).encode(), True)
            for value in (20.5, "20.5", 10**300)
        ),
        (SEEN, b"\xff" * (LARGEST + 1), True),
    ],
)
def test_a_payload_says_on_off_or_unknown(
    sensor: MqttSensor, data: bytes, reading: bool | None
) -> None:
    assert read(sensor, data) is reading


def test_another_word_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(InvalidValueError, match="must be one of full, empty, got 'on'"):
        read(OTHERS, b"on")


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (b"21 degrees", "must be JSON, got '21 degrees'"),
        (b'{"rooms": []}', "must have the field rooms.0.warm, got '{\"rooms\": []}'"),
        (b'{"rooms": {"0": 3}}', "must have the field rooms.0.warm"),
        *(
            (
                b'{"rooms": [{"warm": %s}]}' % value,
                "rooms.0.warm must be a number, or nothing for unknown",
            )
            for value in (b"true", b'"hot"', b"[1]")
        ),
        (b"\xff\xfe", "must be UTF-8 text, got '\ufffd\ufffd'"),
        (b"[" * 2000, "must be JSON, got '" + "[" * 40 + "'"),
        (b" " * (LARGEST + 1), f"must be at most {LARGEST} bytes long, got 65537"),
        (b'{"rooms":"%s"}' % (b"\xc3\xa9" * 99), '\'{"rooms":"' + "é" * 30 + "'"),
    ],
)
def test_what_cannot_be_read_is_quoted_in_part(data: bytes, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(rule)) as caught:
        read(CLIMATE, data)
    assert str(caught.value).startswith("house/door: ")


NUMBERS = st.lists(st.one_of(st.none(), st.integers(-3, 3)), max_size=12)


@given(
    upper=st.integers(-2, 2), gap=st.integers(0, 2), band=st.booleans(), numbers=NUMBERS
)
def test_hysteresis_goes_by_the_last_number_outside_the_band(
    upper: int, gap: int, band: bool, numbers: list[int | None]
) -> None:
    """What it says is what the last number beyond either end said."""
    when, mirror_when = f"> {upper}", f"< {-upper}"
    if band:
        when += f", off < {upper - gap}"
        mirror_when += f", off > {gap - upper}"
    sensor = MqttSensor(name="x", topic="x", when=when)
    mirrored = MqttSensor(name="x", topic="x", when=mirror_when)
    reader, mirror = PayloadReader(sensor), PayloadReader(mirrored)
    for count in range(1, len(numbers) + 1):
        said = numbers[:count]
        payload = Payload("x", json.dumps(said[-1]).encode())
        opposite = None if said[-1] is None else -said[-1]
        since = max((k for k in range(count) if said[k] is None), default=-1)
        beyond = [
            number > upper
            for number in said[since + 1 :]
            if number is not None
            and (number > upper or not (band and gap) or number < upper - gap)
        ]
        expected = beyond[-1] if beyond else None
        assert reader.read(payload) is expected
        assert mirror.read(Payload("x", json.dumps(opposite).encode())) is expected
