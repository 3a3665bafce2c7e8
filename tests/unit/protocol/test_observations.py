"""What an observation says, as arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import ShapeError
from neurosnap.protocol.observations import readings
from neurosnap.sensorium import pack, selection


@given(st.lists(st.sampled_from([True, False, None]), min_size=1, max_size=20))
def test_of_each_known_sensor_one_literal_is_observed(row: list[bool | None]) -> None:
    told = wire.Observation(
        1,
        pack([on is True for on in row]),
        known=pack([on is not None for on in row]),
    )
    literals = selection(*readings(told, len(row)))
    expected = [on is wanted for on in row for wanted in (True, False)]
    assert literals.tolist() == expected


def test_all_are_known_where_nothing_is_said() -> None:
    bits, known = readings(wire.Observation(1, b"\x02"), 3)
    assert bits.tolist() == [False, True, False]
    assert known is None
    assert np.flatnonzero(selection(bits, known)).tolist() == [1, 2, 5]


@pytest.mark.parametrize(("bits", "known"), [(b"\x08", b""), (b"\x00", b"\x08")])
def test_another_number_of_sensors_is_refused(bits: bytes, known: bytes) -> None:
    with pytest.raises(ShapeError, match=r"^packed bits: must be 0 beyond the first 3"):
        readings(wire.Observation(1, bits, known=known), 3)
