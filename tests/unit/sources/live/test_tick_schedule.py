"""The tick schedule matches its definition at every time."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.sources.live.tick_schedule import Clocked, OnChange, TickRule


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


def test_the_wait_is_over_when_it_says() -> None:
    clocked = TickRule(interval=10.0).schedule()
    clocked.begin(0.0)
    clocked.given(0.0)
    clocked.given(4.0)  # a tick that was not due changes nothing
    assert clocked.wait(4.0, changed=True) == 6.0
    schedule = TickRule(min_interval=2.0, max_interval=5.0).schedule()
    schedule.begin(0.0)
    assert schedule.wait(0.0, changed=False) is None
    assert schedule.wait(7.0, changed=True) == 0.0
    schedule.given(7.0)
    assert schedule.wait(8.0, changed=True) == 1.0
    assert schedule.wait(8.0, changed=False) == 4.0
    assert OnChange().wait(1.0, changed=False) is None


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"interval": 0}, "Expected `float` > 0"),
        ({"interval": float("inf")}, "Expected `float` <= 31536000"),
        ({"min_interval": -1}, "Expected `float` >= 0"),
        ({"max_interval": float("nan")}, "Expected `float` > 0"),
        ({"max_interval": 1, "min_interval": 2}, "max_interval: must be min_interval"),
        ({"max_interval": 1, "interval": 2}, "interval: must not come with max_inter"),
    ],
)
def test_intervals_out_of_their_range_or_that_do_not_go_together_are_refused(
    given: dict[str, float], text: str
) -> None:
    with pytest.raises(msgspec.ValidationError, match=f"^{text}"):
        msgspec.convert(given, TickRule)
