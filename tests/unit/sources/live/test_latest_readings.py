"""The latest against a list of everything that ever came."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sources.live.latest_readings import TOLERANCE, LatestReadings

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


@dataclass
class Came:
    sensor: int
    on: bool | None
    at: float
    now: float

    @property
    def read(self) -> float:
        return min(self.at, self.now)


def is_late(came: list[Came], one: Came) -> bool:
    before = came[: came.index(one)]
    return any(b.sensor == one.sensor and b.read > one.read for b in before)


def expected(
    came: list[Came],
    sensor: int,
    now: float,
    stale: float | None,
    seen: float | None,
    began: float,
) -> tuple[bool, bool]:
    """Return the bit and whether it is known, by the rules and nothing else."""
    mine = [c for c in came if c.sensor == sensor]
    if seen is not None:
        if any(now < c.read + seen for c in mine):
            return True, True
        return False, now >= began + seen
    if not mine:
        return False, False
    youngest = max(c.read for c in mine)
    last = [c for c in mine if c.read == youngest][-1]
    if last.on is None or (stale is not None and now >= last.read + stale):
        return False, False
    return last.on, True


@given(COMINGS, SPANS, SPANS, TIMES, TIMES)
def test_a_board_shows_what_the_list_of_all_readings_says(
    comings: list[tuple[int, bool | None, float, float]],
    stale: list[float | None],
    seen: list[float | None],
    began: float,
    wait: float,
) -> None:
    latest = LatestReadings(NAMES, stale_after=stale, seen_within=seen)
    latest.begin(began)
    came: list[Came] = []
    now = began
    for sensor, on, offset, step in comings:
        now += step
        one = Came(sensor, on, now + offset, now)
        came.append(one)
        taken = latest.put(sensor, on, one.at, now)
        assert taken is not is_late(came, one)
    now += wait
    bits, known = latest.observation(now)
    said = [expected(came, k, now, stale[k], seen[k], began) for k in range(len(NAMES))]
    assert list(zip(bits.tolist(), known.tolist(), strict=True)) == said
    assert latest.late == sum(is_late(came, c) for c in came)
    assert latest.ahead == sum(c.at > c.now + TOLERANCE for c in came)


@given(COMINGS, SPANS, SPANS)
def test_nothing_changes_before_the_next_change_and_something_may_then(
    comings: list[tuple[int, bool | None, float, float]],
    stale: list[float | None],
    seen: list[float | None],
) -> None:
    latest = LatestReadings(NAMES, stale_after=stale, seen_within=seen)
    latest.begin(0.0)
    now = 0.0
    for sensor, on, offset, step in comings:
        now += step
        latest.put(sensor, on, now + offset, now)
    shown = np.array(latest.observation(now))
    turn = latest.next_change(now)
    assert turn is None or turn > now
    # Spans and times are small: by then all has changed that is going to.
    end = now + 20 if turn is None else turn
    for moment in np.arange(now, end, 0.5):
        assert np.array_equal(np.array(latest.observation(float(moment))), shown)


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
    once = LatestReadings(NAMES, stale_after=stale, seen_within=seen)
    singly = LatestReadings(NAMES, stale_after=stale, seen_within=seen)
    now = 0.0
    for (readings, offset, step), (sensor, on, other, _) in zip(
        wholes, comings, strict=False
    ):
        now += step
        bits = np.array([reading is True for reading in readings])
        some = np.array([reading is not None for reading in readings])
        taken = [
            singly.put(k, reading, now + offset, now)
            for k, reading in enumerate(readings)
        ]
        assert once.put_all(bits, some, now + offset, now).tolist() == taken
        for latest in (once, singly):
            latest.put(sensor, on, now + other, now)
        shown = [np.array(latest.observation(now)) for latest in (once, singly)]
        assert np.array_equal(shown[0], shown[1])
        assert once.next_change(now) == singly.next_change(now)
    assert (once.late, once.ahead) == (singly.late, singly.ahead)


def test_a_reading_is_believed_until_it_is_as_old_as_it_may_be() -> None:
    latest = LatestReadings(["door"], stale_after=10)
    latest.put(0, True, 5.0, 5.0)
    assert latest.next_change(5.0) == 15.0
    assert np.array(latest.observation(14.999)).tolist() == [[True], [True]]
    assert np.array(latest.observation(15.0)).tolist() == [[False], [False]]
    assert latest.next_change(15.0) is None


def test_a_clock_that_is_ahead_does_not_silence_those_that_are_right() -> None:
    latest = LatestReadings(["door"], stale_after=10)
    assert latest.put(0, True, 3600.0, 1.0)
    assert latest.put(0, False, 2.0, 2.0)
    assert np.array(latest.observation(2.0)).tolist() == [[False], [True]]
    assert np.array(latest.observation(12.0)).tolist() == [[False], [False]]
    assert (latest.late, latest.ahead) == (0, 1)


def test_silence_means_off_once_it_was_listened_to_long_enough() -> None:
    latest = LatestReadings(["phone"], seen_within=30)
    latest.begin(100.0)
    assert np.array(latest.observation(129.0)).tolist() == [[False], [False]]
    assert latest.next_change(100.0) == 130.0
    assert np.array(latest.observation(130.0)).tolist() == [[False], [True]]
    latest.put(0, None, 140.0, 140.0)
    assert np.array(latest.observation(169.0)).tolist() == [[True], [True]]
    assert np.array(latest.observation(170.0)).tolist() == [[False], [True]]


def test_before_anybody_listens_silence_says_nothing() -> None:
    latest = LatestReadings(["phone", "door"], seen_within=[30, None])
    assert latest.observation(1e9)[1].tolist() == [False, False]
    assert latest.next_change(0.0) is None


@pytest.mark.parametrize("name", ["stale_after", "seen_within"])
@pytest.mark.parametrize("span", [0, -1, float("nan"), [1, 0, 2]])
def test_a_span_must_be_above_0(name: str, span: float | list[float]) -> None:
    with pytest.raises(InvalidValueError, match=rf"^{name}: must be above 0, got "):
        LatestReadings(
            NAMES,
            stale_after=span if name == "stale_after" else None,
            seen_within=span if name == "seen_within" else None,
        )


def test_spans_must_be_one_a_sensor() -> None:
    with pytest.raises(ShapeError, match=r"^stale_after: must be 3, one a sensor, got"):
        LatestReadings(NAMES, stale_after=[1, 2])


def test_a_board_has_sensors() -> None:
    with pytest.raises(InvalidValueError, match=r"^sensors: must be one at least, got"):
        LatestReadings([])
