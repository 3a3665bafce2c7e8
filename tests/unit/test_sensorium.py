"""Names, literals and observations."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError, UnknownSensorError
from neurosnap.sensorium import (
    Sensorium,
    complement,
    complete,
    pack,
    selection,
    unpack,
    unpack_readings,
)

DOORS = Sensorium(["door", "motion"])


def test_names_and_literals_go_both_ways() -> None:
    names = ["door", "door*", "motion", "motion*"]
    assert [DOORS.name(literal) for literal in range(4)] == names
    assert [DOORS.literal(name) for name in names] == [0, 1, 2, 3]
    assert list(DOORS) == ["door", "motion"]
    assert DOORS.names == ("door", "motion")


def test_equal_names_make_equal_sensoria() -> None:
    assert Sensorium(("door", "motion")) == DOORS
    assert Sensorium(("motion", "door")) != DOORS
    assert DOORS != ("door", "motion")
    assert len({Sensorium(("door", "motion")), DOORS}) == 1


def test_numbered_sensors() -> None:
    assert Sensorium.of(2).names == ("s0", "s1")
    assert len(Sensorium.of(0)) == 0
    with pytest.raises(
        InvalidValueError, match=r"^sensors: must be 0 or more, got -1$"
    ):
        Sensorium.of(-1)
    with pytest.raises(InvalidValueError, match=r"^sensors: must be a whole number"):
        Sensorium.of(True)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("", "must not be empty"),
        ("door*", r"must not end with \*"),
        ("*", r"must not end with \*"),
        (" door", "must have no space at its ends"),
        ("door\n", "must have no space at its ends"),
        ("do\x00or", "must have no control characters"),
        ("do\u2028or", "must have no control characters"),
        ("do\ud800or", "must have no control characters"),
        (7, "must be text"),
    ],
)
def test_a_bad_name_is_refused(name: str, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"^sensor name: {rule}, got "):
        Sensorium(["fine", name])


def test_names_are_unique_and_several() -> None:
    with pytest.raises(InvalidValueError, match=r"^names: must be unique, got 'a'$"):
        Sensorium(["a", "b", "a"])
    with pytest.raises(InvalidValueError, match=r"^names: must be several, not one"):
        Sensorium("door")


@pytest.mark.parametrize("name", ["window", "window*", "door**", "", "*", 0])
def test_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(UnknownSensorError, match=r"^literal: must name a sensor "):
        DOORS.literal(name)


def test_a_name_that_is_nearly_right_is_asked_after() -> None:
    with pytest.raises(UnknownSensorError, match=r"\(did you mean door\?\), got 'dor"):
        DOORS.literal("dor*")


@pytest.mark.parametrize("literal", [-1, 4, 1.0, "door"])
def test_an_unknown_literal_is_refused(literal: int) -> None:
    with pytest.raises(UnknownSensorError, match=r"^literal: must be .* in \[0, 4\)"):
        DOORS.name(literal)


@pytest.mark.parametrize(
    "bits",
    [[1, 0], [True, False], [1.0, 0.0], (1, 0), np.array([1, 0], np.uint8)],
)
def test_an_observation_comes_out_as_bool(bits: list[int]) -> None:
    array = DOORS.observation(bits)
    assert array.dtype == np.bool_
    assert array.tolist() == [True, False]


@pytest.mark.parametrize(
    ("several", "rule"),
    [
        ([[], [1], [1, 0, 1], [[1, 0]], 1], "must hold 2 bits, one a "),
        ([[0, bit] for bit in (2, -1, 0.5, np.nan, np.inf)], r"must be 0 or 1 \(at 1"),
        ([["0", "1"], [None, 1], [1j, 0], [[1], [1, 0]]], "must be "),
    ],
)
def test_what_is_no_observation_is_refused(several: list[Any], rule: str) -> None:
    for bits in several:
        with pytest.raises(InvalidValueError, match=f"^observation: {rule}"):
            DOORS.observation(bits)


@given(st.lists(st.booleans(), max_size=40))
def test_packing_goes_both_ways(bits: list[bool]) -> None:
    data = pack(bits)
    assert unpack(data, len(bits)).tolist() == bits
    assert [data[k // 8] >> k % 8 & 1 for k in range(len(bits))] == bits


def test_packed_bits_of_another_length_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"^packed bits: must be 2 bytes long for 9 "):
        unpack(b"\0", 9)
    with pytest.raises(InvalidValueError, match=r"^count: must be 0 or more, got -9$"):
        unpack(b"", -9)
    with pytest.raises(ShapeError, match=r"^packed bits: must be 0 beyond the first 4"):
        unpack(b"\x10", 4)
    with pytest.raises(ShapeError, match=r"^bits: must have one axis, got \(1, 1\)$"):
        pack([[1]])


@given(st.lists(st.booleans(), max_size=9))
def test_a_complete_selection_holds_one_literal_a_sensor(bits: list[bool]) -> None:
    literals = complete(np.array(bits, np.bool_))
    assert literals.tolist() == [on for bit in bits for on in (bit, not bit)]
    assert (complement(literals) == ~literals).all()


def test_a_set_of_literals_has_two_places_a_sensor() -> None:
    assert complement(np.array([1, 0, 0, 0], np.bool_)).tolist() == [0, 1, 0, 0]
    with pytest.raises(ShapeError, match=r"^literals: must be \(2N,\), got \(3,\)$"):
        complement(np.zeros(3, np.bool_))
    with pytest.raises(ShapeError, match=r"^observation: must be \(N,\), got \(1, 1\)"):
        complete(np.zeros((1, 1), np.bool_))


def test_importing_it_leaves_numba_alone() -> None:
    code = "import sys, neurosnap.sensorium; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@given(st.lists(st.sampled_from([True, False, None]), min_size=1, max_size=20))
def test_of_each_known_sensor_one_literal_is_observed(row: list[bool | None]) -> None:
    bits, known = pack([on is True for on in row]), pack([on is not None for on in row])
    literals = selection(*unpack_readings(bits, known, len(row)))
    expected = [on is wanted for on in row for wanted in (True, False)]
    assert literals.tolist() == expected


def test_all_are_known_where_nothing_is_said() -> None:
    bits, known = unpack_readings(b"\x02", b"", 3)
    assert bits.tolist() == [False, True, False]
    assert known is None
    assert np.flatnonzero(selection(bits, known)).tolist() == [1, 2, 5]
