"""Topics find their sensors, as the standard has it."""

import re

from hypothesis import given
from hypothesis import strategies as st

from neurosnap.sources.mqtt.mqtt_source import REMEMBERED, Routes
from neurosnap.sources.mqtt.options import is_filter

LEVELS = st.sampled_from(["a", "b", "", "$x"])
TOPICS = st.lists(LEVELS, min_size=1, max_size=4).map("/".join).filter(bool)
FILTERS = (
    st.lists(st.sampled_from(["a", "b", "", "+", "#", "$x"]), min_size=1, max_size=4)
    .map("/".join)
    .filter(is_filter)
)


def matches(wildcard: str, topic: str) -> bool:
    """The standard's rules as a regular expression."""
    if topic.startswith("$") and wildcard[0] in "+#":
        return False
    pattern = re.escape(wildcard).replace(r"\+", "[^/]*").replace(r"\#", "#")
    pattern = re.sub(r"(^|/)#$", lambda found: "(/.*)?" if found[1] else ".*", pattern)
    return re.fullmatch(pattern, topic) is not None


@given(filters=st.lists(FILTERS, max_size=5), topics=st.lists(TOPICS, max_size=5))
def test_a_topic_feeds_every_sensor_whose_filter_it_matches(
    filters: list[str], topics: list[str]
) -> None:
    routes = Routes(filters)
    for topic in topics * 2:
        expected = [k for k, wildcard in enumerate(filters) if matches(wildcard, topic)]
        assert list(routes.of(topic)) == expected


def test_topics_without_end_are_not_all_remembered() -> None:
    routes = Routes(["#"])
    for number in range(2 * REMEMBERED):
        routes.of(f"t/{number}")
    remembered = routes.of.cache_info().currsize  # type: ignore[attr-defined]
    assert remembered == REMEMBERED
