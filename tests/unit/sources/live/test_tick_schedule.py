"""Paces against the definition, moment by moment."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.sources.live.tick_schedule import Clocked, OnChange, new_schedule


@given(
    st.integers(1, 5),
    st.integers(0, 7),
    st.lists(st.integers(0, 17), max_size=12),
)
def test_a_late_tick_is_given_at_once_and_those_it_hid_are_skipped(
    interval: int, began: int, busy: list[int]
) -> None:
    schedule = Clocked(float(interval))
    schedule.begin(float(began))
    now, skipped, last = began, 0, began - 1
    for span in busy:
        # The first moment of the grid that no tick has been given for.
        due = began + interval * math.ceil((last + 1 - began) / interval)
        wait = schedule.wait(float(now), changed=False)
        assert wait == max(0, due - now)
        now = max(now, due)
        schedule.given(float(now))
        skipped += sum((t - began) % interval == 0 for t in range(due + 1, now + 1))
        assert schedule.skipped == skipped
        last = now
        now += span


@given(st.floats(1e-6, 1e6), st.floats(0, 1e9), st.lists(st.floats(0, 1e3)))
def test_whatever_the_numbers_a_tick_given_is_not_due_again(
    interval: float, began: float, waits: list[float]
) -> None:
    schedule = Clocked(interval)
    schedule.begin(began)
    now = began
    for more in waits:
        wait = schedule.wait(now, changed=True)
        assert wait is not None
        now += more
        if schedule.wait(now, changed=True) == 0:
            schedule.given(now)
            after = schedule.wait(now, changed=True)
            assert after is not None
            # As exact as the sum of a large and a small number can be.
            assert 0 <= after <= interval + 4 * math.ulp(now)
            assert after > 0 or interval < 4 * math.ulp(now)


@pytest.mark.parametrize("interval", [0.1, 0.3, 1 / 3])
def test_no_moment_of_the_grid_is_given_twice_or_skipped(interval: float) -> None:
    # Most of these products are not where the division says they are.
    schedule = Clocked(interval)
    schedule.begin(0.0)
    for number in range(1000):
        now = number * interval
        assert schedule.wait(now, changed=False) == 0
        schedule.given(now)
        after = schedule.wait(now, changed=False)
        assert after == pytest.approx(interval)
        late = Clocked(interval)
        late.begin(0.0)
        late.given(now)
        assert late.wait(now, changed=False) == pytest.approx(interval)
        assert late.skipped == number
    assert schedule.skipped == 0


def test_a_tick_nobody_asked_for_changes_nothing() -> None:
    schedule = Clocked(10.0)
    schedule.begin(0.0)
    schedule.given(0.0)
    schedule.given(4.0)
    assert schedule.wait(4.0, changed=False) == 6.0
    assert schedule.skipped == 0


@given(
    st.integers(0, 4),
    st.none() | st.integers(1, 9),
    st.lists(st.tuples(st.integers(0, 6), st.booleans()), max_size=12),
)
def test_a_change_shows_as_soon_as_it_may_and_no_change_when_it_must(
    least: int, most: int | None, moments: list[tuple[int, bool]]
) -> None:
    if most is not None and most < least:
        least, most = most, least or 1
    schedule = OnChange(float(least), None if most is None else float(most))
    schedule.begin(0.0)
    now, last = 0, None
    for span, changed in moments:
        now += span
        due = (changed and (last is None or now >= last + least)) or (
            last is not None and most is not None and now >= last + most
        )
        assert (schedule.wait(float(now), changed) == 0) == due
        if due:
            schedule.given(float(now))
            last = now


def test_the_wait_is_over_when_it_says() -> None:
    schedule = OnChange(2.0, 5.0)
    schedule.begin(0.0)
    assert schedule.wait(0.0, changed=False) is None
    assert schedule.wait(7.0, changed=True) == 0.0
    schedule.given(7.0)
    assert schedule.wait(8.0, changed=True) == 1.0
    assert schedule.wait(8.0, changed=False) == 4.0
    assert OnChange().wait(1.0, changed=False) is None


def test_a_pace_is_by_the_clock_or_on_change() -> None:
    clocked = new_schedule(2.0, 0.0, None)
    clocked.begin(0.0)
    clocked.given(0.0)
    assert clocked.wait(0.5, changed=True) == 1.5
    on_change = new_schedule(None, 1.0, 3.0)
    on_change.given(0.0)
    assert on_change.wait(0.5, changed=True) == 0.5
    assert on_change.wait(0.5, changed=False) == 2.5


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ((0, 0.0, None), "interval: must be above 0, finite"),
        ((float("nan"), 0.0, None), "interval: must be above 0, finite"),
        ((float("inf"), 0.0, None), "interval: must be above 0, finite"),
        ((None, -1, None), "min_interval: must be 0 or more"),
        ((None, float("nan"), None), "min_interval: must be 0 or more"),
        ((None, 0, 0), "max_interval: must be above 0, and min_interval or more, got "),
        ((None, 2, 1), "max_interval: must be above 0, and min_interval or more, got "),
        ((None, 0, float("nan")), "max_interval: must be above 0, and min_interval"),
        ((2.0, 1.0, None), "interval: must not come with min_interval or max_interval"),
        ((2.0, 0.0, 5.0), "interval: must not come with min_interval or max_interval"),
    ],
)
def test_intervals_out_of_their_range_or_that_do_not_go_together_are_refused(
    given: tuple[float | None, float, float | None], text: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{text}"):
        new_schedule(*given)
