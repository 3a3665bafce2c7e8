"""One sensor that is read from several topics.

Each topic has a latest reading of its own, which goes stale by itself. They combine at
any time into one reading: with `any`, on where one of those that are known is on, off
where all of them are off; with `all`, off where one is off, on where all are on.

Topics come from outside, without end: only the latest `REMEMBERED` of a sensor count.
"""

from typing import Literal, TypeAlias

Combine: TypeAlias = Literal["any", "all", "last"]
"""How several topics are one sensor; `last`: the latest message of them all counts."""

REMEMBERED = 4096
"""Topics of a sensor whose readings are remembered."""

_NEVER = float("-inf")


class CombinedTopics:
    """The latest reading of each topic of a sensor; every operation is O(1).

    Times never go back from call to call, so the entries of a table, in the order they
    were put, are in the order of their times as well.
    """

    def __init__(self) -> None:
        self._until: dict[bool, dict[str, float]] = {False: {}, True: {}}

    def put(self, topic: str, on: bool | None, until: float) -> None:
        """Take in a reading, which replaces the topic's last one.

        Args:
            topic: Whose.
            on: What it says; None: nothing is known of the topic any more.
            until: When it goes stale; never before any given earlier.
        """
        for said in self._until.values():
            said.pop(topic, None)
        if on is None:
            return
        self._until[on][topic] = until
        if sum(map(len, self._until.values())) > REMEMBERED:
            oldest = min(filter(None, self._until.values()), key=_first)
            del oldest[next(iter(oldest))]

    def last_until(self, on: bool) -> float:
        """Return until when one of the topics says `on`, if nothing more comes."""
        said = self._until[on]
        return said[next(reversed(said))] if said else _NEVER

    def first_until(self, on: bool) -> float:
        """Return until when all topics that say `on` still do."""
        said = self._until[on]
        return _first(said) if said else _NEVER

    def clear(self) -> None:
        """Forget all topics."""
        for said in self._until.values():
            said.clear()


def _first(said: dict[str, float]) -> float:
    return said[next(iter(said))]
