"""Payloads become readings, against rules written apart."""

import json
import re

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.latest_readings import REMEMBERED
from neurosnap.sources.meaning import OFF, ON
from neurosnap.sources.mqtt.options import MqttSensor
from neurosnap.sources.mqtt.payload import LARGEST, Payload, PayloadReader


def read(sensor: MqttSensor, data: bytes) -> bool | None:
    return PayloadReader(sensor).read(Payload("house/door", data))


WORDS = MqttSensor(name="door", topic="house/door")
CLIMATE = MqttSensor(name="warm", topic="#", field="rooms.0.warm", on_above=20.0)


@pytest.mark.parametrize("word", ON)
def test_a_word_for_on_is_on_in_any_case_and_space(word: str) -> None:
    assert read(WORDS, f"  {word.upper()}\r\n".encode()) is True


@pytest.mark.parametrize("word", OFF)
def test_a_word_for_off_is_off_in_any_case_and_space(word: str) -> None:
    assert read(WORDS, f"\t{word.title()} ".encode()) is False


@pytest.mark.parametrize("data", [b"", b" ", b"None", b"null", b"unavailable"])
def test_some_words_say_that_nothing_is_known(data: bytes) -> None:
    assert read(WORDS, data) is None


def test_words_can_be_others() -> None:
    sensor = MqttSensor(name="x", topic="x", on=("Full",), off=("Empty",))
    assert read(sensor, b"full") is True
    assert read(sensor, b"EMPTY") is False
    with pytest.raises(InvalidValueError, match="must be one of Full, Empty, got 'on'"):
        read(sensor, b"on")


@pytest.mark.parametrize(
    ("value", "reading"),
    [(True, True), (False, False), (1, True), (0.0, False), ("ON", True), (None, None)],
)
def test_a_field_says_what_the_word_would(value: object, reading: bool | None) -> None:
    sensor = MqttSensor(name="x", topic="x", field="a.b")
    data = json.dumps({"a": {"b": value}, "battery": 3}).encode()
    assert read(sensor, data) is reading


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (b"21 degrees", "must be JSON, got '21 degrees'"),
        (b'{"rooms": []}', "must have the field rooms.0.warm, got '{\"rooms\": []}'"),
        (b'{"rooms": {"0": 3}}', "must have the field rooms.0.warm"),
        (b'{"rooms": [{"warm": true}]}', "must be a finite number"),
        (b'{"rooms": [{"warm": "hot"}]}', "must be a finite number"),
        (b'{"rooms": [{"warm": "inf"}]}', "must be a finite number"),
        (b'{"rooms": [{"warm": [1]}]}', "must be a finite number"),
        (b"\xff\xfe", "must be UTF-8 text, got '\ufffd\ufffd'"),
        (b"[" * 2000, "must be JSON, got '" + "[" * 40 + "'"),
        (b" " * (LARGEST + 1), f"must be at most {LARGEST} bytes long, got 65537"),
        (b'{"rooms":"%s"}' % (b"\xc3\xa9" * 99), '\'{"rooms":"' + "é" * 30 + "'"),
    ],
)
def test_what_cannot_be_read_is_quoted_in_part(data: bytes, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(rule)) as caught:
        read(CLIMATE, data)
    assert str(caught.value).startswith("house/door: must")


@pytest.mark.parametrize("value", [20.5, "20.5", 10**300])
def test_a_number_may_be_text(value: object) -> None:
    assert read(CLIMATE, json.dumps({"rooms": [{"warm": value}]}).encode()) is True


NUMBERS = st.lists(st.one_of(st.none(), st.integers(-3, 3)), max_size=12)


@given(upper=st.integers(-2, 2), gap=st.integers(0, 2), numbers=NUMBERS)
def test_hysteresis_goes_by_the_last_number_outside_the_band(
    upper: int, gap: int, numbers: list[int | None]
) -> None:
    """What it says is what the last number beyond either end said."""
    sensor = MqttSensor(name="x", topic="x", on_above=upper, off_below=upper - gap)
    mirrored = MqttSensor(name="x", topic="x", on_below=-upper, off_above=gap - upper)
    reader, mirror = PayloadReader(sensor), PayloadReader(mirrored)
    for count in range(1, len(numbers) + 1):
        said = numbers[:count]
        payload = Payload("x", json.dumps(said[-1]).encode())
        opposite = None if said[-1] is None else -said[-1]
        since = max((k for k in range(count) if said[k] is None), default=-1)
        beyond = [
            number > upper
            for number in said[since + 1 :]
            if number is not None and (number > upper or number < upper - gap)
        ]
        expected = beyond[-1] if beyond else None
        assert reader.read(payload) is expected
        assert mirror.read(Payload("x", json.dumps(opposite).encode())) is expected


@given(limit=st.integers(-2, 2), number=st.integers(-3, 3))
def test_without_a_band_every_number_says_something(limit: int, number: int) -> None:
    data = str(number).encode()
    above = MqttSensor(name="x", topic="x", on_above=limit)
    below = MqttSensor(name="x", topic="x", on_below=limit)
    assert read(above, data) is (number > limit)
    assert read(below, data) is (number < limit)


def test_whatever_is_published_is_a_sign_of_life() -> None:
    sensor = MqttSensor(name="phone", topic="wifi/#", seen_within=30)
    assert read(sensor, b"\xff" * (LARGEST + 1)) is True


def test_each_topic_of_a_wildcard_has_a_hysteresis_of_its_own() -> None:
    each = MqttSensor(name="warm", topic="+/t", on_above=22, off_below=20)
    one = msgspec.structs.replace(each, combine="last")
    said = [("a/t", b"23"), ("b/t", b"19"), ("a/t", b"21"), ("b/t", b"21")]
    for sensor, expected in [
        (each, [True, False, True, False]),
        (one, [True, False, False, False]),
    ]:
        reader = PayloadReader(sensor)
        assert [reader.read(Payload(*it)) for it in said] == expected


def test_the_hysteresis_of_topics_without_end_is_bounded() -> None:
    reader = PayloadReader(
        MqttSensor(name="warm", topic="+/t", on_above=22, off_below=20)
    )
    for number in range(REMEMBERED + 1):
        assert reader.read(Payload(f"{number}/t", b"23")) is True
    assert reader.read(Payload("0/t", b"21")) is None
    assert reader.read(Payload("2/t", b"21")) is True
