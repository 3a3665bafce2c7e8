"""Readings in JSON: valid ones, their values, and errors."""

import contextlib

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.json_reading import LIMIT, Reading, read
from neurosnap.sources.live.signal_readers import SignalReaders

ON = [True, 1, "on", "ON", "True", "1", " on "]
OFF = [False, 0, 0.0, "off", "Off", "FALSE", "closed"]
UNKNOWN = [None, "", "null", "unavailable"]


def test_a_value_is_on_or_off() -> None:
    read_on = SignalReaders({"reading": (None,)}).read
    for said in (*ON, *OFF, *UNKNOWN):
        expected = None if said in UNKNOWN else said in ON
        assert read_on({"reading": said}) == ({"reading": expected}, [])
    rule = "reading: must be 0 or 1, false or true, off or on, or nothing for unknown"
    for said in (2, -1, 0.5, "ajar"):
        _, (error,) = read_on({"reading": said})
        assert str(error).startswith(rule)


@given(
    st.text('aß"\\\n\x7f 😀', min_size=1),
    st.sampled_from([*ON, *OFF, None]),
    st.none() | st.floats(0, 1e10),
)
def test_a_single_reading_says_what_was_written(
    sensor: str, on: bool | int | str | None, at: float | None
) -> None:
    said = read(msgspec.json.encode({"sensor": sensor, "on": on, "at": at}))
    assert said == Reading(sensor, on, at=at)


def test_a_whole_reading_is_by_name_or_in_order() -> None:
    said = read(b'{"bits": [1, "off", null], "at": 7}')
    assert said.at == 7.0
    assert said.values(["a", "b", "c"]) == {"a": 1, "b": "off", "c": None}
    assert read(b'{"bits": {"b": 1}}').values(["a", "b"]) == {"b": 1}
    with pytest.raises(ShapeError, match=r"^bits: must be 2, one a sensor, got 3$"):
        said.values(["a", "b"])


@pytest.mark.parametrize(
    ("payload", "rule"),
    [
        (b"", "must be a reading in JSON"),
        (b"[1, 0]", "must be a reading in JSON"),
        (b"\xff", "must be a reading in JSON"),
        (b"[" * 100_000, "must be a reading in JSON"),
        (b'{"bits": ' + b"[" * 100_000, "must be a reading in JSON"),
        (b'{"bits": [0], "att": 1}', "must be a reading in JSON"),
        (b'{"sensor": "a", "on": 1, "at": 1e999}', "must be a reading in JSON"),
        (b'{"sensor": "\\ud800", "on": 1}', "must be a reading in JSON"),
        (b'{"sensor": 7, "on": 1}', "must be a reading in JSON"),
        (b"{}", "must have the fields sensor and on, or bits"),
        (b'{"sensor": "a"}', "must have the fields"),
        (b'{"sensor": "a", "on": 1, "bits": [1]}', "must have the fields"),
        (b'{"on": 1, "bits": [1]}', "must have the fields"),
        (b" " * LIMIT + b"{}", f"must be up to {LIMIT} bytes"),
    ],
)
def test_what_is_no_reading(payload: bytes, rule: str) -> None:
    with pytest.raises(InvalidValueError) as caught:
        read(payload)
    assert rule in caught.value.rule
    assert len(str(caught.value)) < 500


@given(st.binary(max_size=40))
def test_any_bytes_are_a_reading_or_refused(payload: bytes) -> None:
    with contextlib.suppress(InvalidValueError):
        assert isinstance(read(payload), Reading)
