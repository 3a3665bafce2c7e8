"""The latest readings equal those taken from a full log."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.latest_or_late import LatestReadings

NAMES = ["door", "motion", "window"]
# Whole numbers, so that sums and differences are exact and ages hit their bounds.
TIMES = st.integers(0, 12).map(float)
SPANS = st.lists(st.none() | st.integers(1, 4).map(float), min_size=3, max_size=3)
COMINGS = st.lists(
    st.tuples(
        st.integers(0, 2),
        st.sampled_from([True, False, None]),
        st.integers(-4, 4).map(float),
        TIMES,
    ),
    max_size=20,
)


class Came(NamedTuple):
    """A reading, at the time that it counts from."""

    sensor: int
    on: bool | None
    read: float


def expected(
    came: list[Came],
    sensor: int,
    now: float,
    stale: float | None,
    seen: float | None,
    began: float,
) -> bool | None:
    """Return what is read, or None if it is unknown, by the rules and nothing else."""
    mine = [c for c in came if c.sensor == sensor]
    if seen is not None:
        if any(now < c.read + seen for c in mine):
            return True
        return False if now >= began + seen else None
    if not mine:
        return None
    last = max(reversed(mine), key=lambda c: c.read)  # of equals the last one
    return None if stale is not None and now >= last.read + stale else last.on


def shown(latest: LatestReadings, now: float) -> list[bool | None]:
    bits, known = latest.observation(now)
    return [bool(b) if k else None for b, k in zip(bits, known, strict=True)]


def check_next_change(latest: LatestReadings, now: float) -> None:
    """Nothing changes before it."""
    turn = latest.next_change(now)
    assert turn is None or turn > now
    # Spans and times are small: by then all has changed that is going to.
    for moment in np.arange(now, now + 20 if turn is None else turn, 0.5):
        assert shown(latest, float(moment)) == shown(latest, now)


@given(COMINGS, SPANS, SPANS, TIMES, TIMES)
def test_a_board_shows_what_the_list_of_all_readings_says(
    comings: list[tuple[int, bool | None, float, float]],
    stale: list[float | None],
    seen: list[float | None],
    began: float,
    wait: float,
) -> None:
    latest = LatestReadings(NAMES, stale_after=stale, heard_within=seen)
    latest.start_listening(began)
    came: list[Came] = []
    now = began
    for sensor, on, offset, step in comings:
        now += step
        one = Came(sensor, on, now + min(offset, 0.0))
        is_late = any(b.sensor == sensor and b.read > one.read for b in came)
        came.append(one)
        assert latest.update(sensor, on, now + offset, now) is not is_late
    now += wait
    assert shown(latest, now) == [
        expected(came, k, now, stale[k], seen[k], began) for k in range(len(NAMES))
    ]
    check_next_change(latest, now)


@given(
    st.lists(
        st.tuples(
            st.lists(st.sampled_from([True, False, None]), min_size=3, max_size=3),
            st.integers(-4, 4).map(float),
            TIMES,
        ),
        max_size=8,
    ),
    COMINGS,
    SPANS,
    SPANS,
)
def test_all_at_once_is_as_one_after_the_other(
    wholes: list[tuple[list[bool | None], float, float]],
    comings: list[tuple[int, bool | None, float, float]],
    stale: list[float | None],
    seen: list[float | None],
) -> None:
    once = LatestReadings(NAMES, stale_after=stale, heard_within=seen)
    singly = LatestReadings(NAMES, stale_after=stale, heard_within=seen)
    now = 0.0
    for (readings, offset, step), (sensor, on, other, _) in zip(
        wholes, comings, strict=False
    ):
        now += step
        bits = np.array([reading is True for reading in readings])
        some = np.array([reading is not None for reading in readings])
        once.update_all(bits, some, now + offset, now)
        for k, reading in enumerate(readings):
            singly.update(k, reading, now + offset, now)
        for latest in (once, singly):
            latest.update(sensor, on, now + other, now)
        assert shown(once, now) == shown(singly, now)
        assert once.next_change(now) == singly.next_change(now)


def test_before_anybody_listens_silence_says_nothing() -> None:
    latest = LatestReadings(["phone", "door"], heard_within=[30, None])
    assert latest.observation(1e9)[1].tolist() == [False, False]
    assert latest.next_change(0.0) is None


@pytest.mark.parametrize(
    ("sensors", "more", "text"),
    [
        (NAMES, {"stale_after": 0}, "stale_after: must be above 0, got 0"),
        (NAMES, {"stale_after": float("nan")}, "stale_after: must be above 0, got nan"),
        (NAMES, {"heard_within": [1, 0, 2]}, "heard_within: must be above 0, got 0"),
        (NAMES, {"stale_after": [1, 2]}, "stale_after: must be 3, one a sensor, got 2"),
        ([], {}, "sensors: must be one at least, got"),
    ],
)
def test_what_does_not_fit_the_sensors_is_refused(
    sensors: list[str], more: dict[str, Any], text: str
) -> None:
    with pytest.raises((InvalidValueError, ShapeError), match=f"^{text}"):
        LatestReadings(sensors, **more)


def test_what_was_heard_before_the_connection_was_lost_says_nothing_any_more() -> None:
    latest = LatestReadings(["phone"], heard_within=3)
    latest.start_listening(0.0)
    latest.update(0, True, 1.0, 1.0)
    latest.stop_listening()
    assert shown(latest, 2.0) == [None]
    latest.start_listening(2.0)
    assert [shown(latest, now) for now in (4.9, 5.0)] == [[None], [False]]
