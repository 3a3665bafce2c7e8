"""Messages that parts refuse, and how many readings cells and workers keep."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.protocol.cell_and_worker_base import (
    AHEAD,
    READINGS,
    WAVES,
    RecentReadings,
    check_number,
    check_readings,
    check_room,
)
from tests.support.refusals import refusal


@pytest.mark.parametrize("heard", [1, 7, 90_000])
def test_a_number_may_be_so_far_beyond_the_last_and_no_further(heard: int) -> None:
    assert refusal(check_number, "epoch", heard + AHEAD, heard) is None
    rule = f"epoch must be at most 4096 beyond {heard}, got {heard + AHEAD + 1}"
    assert refusal(check_number, "epoch", heard + AHEAD + 1, heard) == rule
    assert refusal(check_number, "epoch", 1, heard) is None
    assert refusal(check_number, "epoch", 2**31 - 1, 0) is None  # the first


def test_a_wave_that_is_known_always_has_room() -> None:
    known = range(1, WAVES + 1)
    assert refusal(check_room, "pulse", WAVES, known) is None
    assert refusal(check_room, "pulse", WAVES + 1, known[1:]) is None
    rule = "pulse: must be of 8192 waves in all, got wave 8193 too"
    assert refusal(check_room, "pulse", WAVES + 1, known) == rule


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 40)), max_size=60))
def test_the_latest_readings_are_kept_that_a_wave_may_be_of(
    said: list[tuple[bool, int]],
) -> None:
    latch, joined, kept = RecentReadings[str](), 0, dict[int, str]()
    for is_wave, tick in said:
        wrong = refusal(latch.check_tick, "observation", tick)
        assert (wrong is not None) == (joined > 0 and tick > joined + READINGS)
        if is_wave:
            latch.join(tick)
            joined = max(joined, tick)
            kept = {t: r for t, r in kept.items() if t <= joined + READINGS}
        elif wrong is None:
            latch.keep(tick, f"read {tick}")
            kept = {t: f"read {t}" for t in sorted({*kept, tick})[-READINGS:]}
        there = {t: latch[t] for t in range(1, 41) if t in latch}
        assert there == kept


@pytest.mark.parametrize(
    ("bits", "known", "wrong"),
    [
        (b"\xff\x01", b"", None),
        (b"\x05", b"\x07", None),
        (b"\x00", b"\x80", None),
        (b"\x00\x00", b"\x00\x01", None),
        (b"\x05", b"\x07\x00", "must say which of 1 bytes are known, got 2 bytes"),
        (b"\x05\x00", b"\x07", "must say which of 2 bytes are known, got 1 bytes"),
        (b"\x00", b"\x00", "must hold a reading that is known, got none"),
        (b"\x05", b"\x04", "must be 0 where it is not known, got sensor 0 on"),
        (b"\x00\x02", b"\xff\x01", "must be 0 where it is not known, got sensor 9 on"),
    ],
)
def test_what_cannot_be_partial_is_named(
    bits: bytes, known: bytes, wrong: str | None
) -> None:
    said = refusal(check_readings, wire.Observation(1, bits, known=known))
    assert said == (wrong and f"observation: {wrong}")
