"""What every part refuses: observations that cannot be partial as they say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.message_checks import check_readings
from tests.support.refusals import refusal


def test_an_observation_that_says_nothing_of_it_is_whole() -> None:
    assert refusal(check_readings, wire.Observation(1, b"\xff\x01")) is None


@pytest.mark.parametrize(
    ("bits", "known", "wrong"),
    [
        (b"\x05", b"\x07", None),
        (b"\x00", b"\x80", None),
        (b"\x00\x00", b"\x00\x01", None),
        (
            b"\x05",
            b"\x07\x00",
            "observation: must say which of 1 bytes are known, got 2 bytes",
        ),
        (
            b"\x05\x00",
            b"\x07",
            "observation: must say which of 2 bytes are known, got 1 bytes",
        ),
        (b"\x00", b"\x00", "observation: must hold a reading that is known, got none"),
        (
            b"\x05",
            b"\x04",
            "observation: must be 0 where it is not known, got sensor 0 on",
        ),
        (
            b"\x00\x02",
            b"\xff\x01",
            "observation: must be 0 where it is not known, got sensor 9 on",
        ),
    ],
)
def test_what_cannot_be_partial_is_named(
    bits: bytes, known: bytes, wrong: str | None
) -> None:
    assert refusal(check_readings, wire.Observation(1, bits, known=known)) == wrong


@given(
    st.lists(st.sampled_from([True, False, None]), min_size=1, max_size=20),
    st.integers(0, 19),
)
def test_it_is_right_iff_the_unknown_are_off_and_one_is_known(
    row: list[bool | None], place: int
) -> None:
    def packed(on: list[bool]) -> bytes:
        return sum(bit << k for k, bit in enumerate(on)).to_bytes(3, "little")

    known = packed([on is not None for on in row])
    bits = [on is True for on in row]
    told = wire.Observation(1, packed(bits), known=known)
    assert (refusal(check_readings, told) is None) == any(on is not None for on in row)
    bits[place % len(row)] = True
    told = wire.Observation(1, packed(bits), known=known)
    assert (refusal(check_readings, told) is None) == (
        row[place % len(row)] is not None
    )
