"""Stamps in one clock's seconds, as another's."""

from hypothesis import given
from hypothesis import strategies as st

from neurosnap.sources.live.latest_readings import TOLERANCE
from neurosnap.sources.live.live_source import ClockMapping

EPOCH = 1_690_000_000.0


@given(
    st.lists(
        st.tuples(st.integers(0, 100), st.floats(-0.4, 0.4)), min_size=2, max_size=20
    )
)
def test_equal_stamps_stay_equal_and_order_is_kept(
    stamps: list[tuple[int, float]],
) -> None:
    made = ClockMapping(7.0, EPOCH)
    # The two clocks are never read at quite the same moment.
    converted = [
        (at, made.on_our_clock(EPOCH + at, now, EPOCH + now - 7.0 + jitter))
        for now, (at, jitter) in enumerate(stamps, 7)
    ]
    for at, ours in converted:
        for other, theirs in converted:
            assert (at < other) == (ours < theirs)


def test_a_wall_clock_put_right_counts_from_then_on() -> None:
    made = ClockMapping(0.0, 1000.0)
    assert made.on_our_clock(1004.0, 5.0, 1005.0 + TOLERANCE / 2) == 4.0
    assert made.on_our_clock(9004.0, 5.0, 9005.0) == 4.0
    assert made.on_our_clock(9006.0, 7.0, 9007.0) == 6.0
