"""Topics that combine into one sensor, against a list of all that was said."""

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.sources.live.latest_readings import (
    REMEMBERED,
    Combine,
    CombinedTopics,
    LatestReadings,
)

# Whole numbers, so that ages hit their bounds.
SAID = st.lists(
    st.tuples(
        st.sampled_from("abc"),
        st.sampled_from([True, False, None]),
        st.integers(0, 3).map(float),
    ),
    max_size=20,
)
SPANS = st.none() | st.integers(1, 5).map(float)
WAYS = st.sampled_from(["any", "all", "last"])


@dataclass
class Said:
    topic: str
    on: bool | None
    at: float


def combined(way: Combine, values: list[bool]) -> bool | None:
    if not values:
        return None
    return any(values) if way == "any" else all(values)


def expected(
    way: Combine, said: list[Said], now: float, stale: float | None
) -> bool | None:
    """Return what the sensor reads, by the rules and nothing else."""
    latest = {"" if way == "last" else one.topic: one for one in said}
    fresh = [one for one in latest.values() if stale is None or now < one.at + stale]
    return combined(way, [one.on for one in fresh if one.on is not None])


def expected_seen(
    way: Combine, said: list[Said], now: float, seen: float, heard_since: float
) -> bool | None:
    latest = {"" if way == "last" else one.topic: one.at for one in said}
    there = [now < at + seen for at in latest.values()]
    if there:
        return combined(way, there)
    return False if now >= heard_since + seen else None


def shown(latest: LatestReadings, now: float) -> bool | None:
    bits, known = latest.observation(now)
    return bool(bits[0]) if known[0] else None


@given(way=WAYS, said=SAID, stale=SPANS, wait=st.integers(0, 8))
def test_a_sensor_reads_what_the_list_of_all_that_was_said_does(
    way: Combine, said: list[tuple[str, bool | None, float]], stale: float, wait: int
) -> None:
    latest = LatestReadings(["motion"], stale_after=stale, combine=[way])
    past: list[Said] = []
    now = 0.0
    assert shown(latest, now) is None
    for topic, on, step in said:
        now += step
        past.append(Said(topic, on, now))
        latest.update(0, on, now, now, topic)
        assert shown(latest, now) == expected(way, past, now, stale)
    now += wait
    assert shown(latest, now) == expected(way, past, now, stale)
    turn = latest.next_change(now)
    for moment in np.arange(now, now + 8 if turn is None else turn, 0.5):
        assert shown(latest, float(moment)) == shown(latest, now)


@given(
    way=WAYS,
    said=SAID,
    seen=st.integers(1, 5),
    away=st.none() | st.integers(0, 20),
    wait=st.integers(0, 8),
)
def test_topics_that_are_seen_combine_as_their_presence_does(
    way: Combine,
    said: list[tuple[str, bool | None, float]],
    seen: int,
    away: int | None,
    wait: int,
) -> None:
    """What was heard before the connection was lost says nothing any more."""
    latest = LatestReadings(["phone"], seen_within=seen, combine=[way])
    latest.start_listening(0.0)
    past: list[Said] = []
    now = since = 0.0
    for number, (topic, on, step) in enumerate(said):
        now += step
        if number == away:
            latest.stop_listening()
            assert shown(latest, now) is None
            latest.start_listening(now)
            past, since = [], now
        past.append(Said(topic, on, now))
        latest.update(0, on, now, now, topic)
        assert shown(latest, now) == expected_seen(way, past, now, seen, since)
    now += wait
    assert shown(latest, now) == expected_seen(way, past, now, seen, since)


def test_a_whole_reading_says_all_there_is_to_say() -> None:
    latest = LatestReadings(["motion"], combine=["any"])
    latest.update(0, True, 0.0, 0.0, "kitchen")
    latest.update_all(np.array([False]), np.array([True]), 1.0, 1.0)
    latest.update(0, False, 2.0, 2.0, "bath")
    assert shown(latest, 2.0) is False


def test_of_topics_without_end_the_oldest_are_forgotten() -> None:
    topics = CombinedTopics()
    for number in range(REMEMBERED + 2):
        topics.update(str(number), number % 2 == 0, float(number))
    assert topics.first_until(True) == 2.0
    assert topics.first_until(False) == 3.0
    assert topics.last_until(True) == REMEMBERED
    topics.update(str(REMEMBERED), None, 9e9)
    assert topics.last_until(True) == REMEMBERED - 2
