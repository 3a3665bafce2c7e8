"""Maps topics to sensors, with a cache.

Topics come from outside, without end; so the memory is bounded, and a topic that is
forgotten is only looked up again.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import aiomqtt

REMEMBERED = 4096
"""Topics whose sensors are remembered."""


class Routes:
    """The filters that topics match, by their place.

    Args:
        filters: Topic filters, one a sensor; some may be the same.
    """

    def __init__(self, filters: Sequence[str]) -> None:
        self._wildcards = [aiomqtt.Wildcard(each) for each in filters]
        self.of: Callable[[str], tuple[int, ...]] = lru_cache(REMEMBERED)(self._match)
        """Return the places of the filters that a topic matches, ascending. O(1) for a
        topic that is remembered, O(filters) otherwise."""

    def _match(self, topic: str) -> tuple[int, ...]:
        known = aiomqtt.Topic(topic)
        return tuple(
            place
            for place, wildcard in enumerate(self._wildcards)
            if known.matches(wildcard) and not _hidden(topic, wildcard.value)
        )


def _hidden(topic: str, wildcard: str) -> bool:
    """Whether it is one of the broker's own topics, which no leading wildcard means.

    The standard says so (4.7.2) and brokers heed it, but one that another filter
    subscribed to comes all the same, and the library's matcher would let it pass.
    """
    return topic.startswith("$") and wildcard.startswith(("+", "#"))
