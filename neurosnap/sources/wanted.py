"""Which sensors of some data are wanted, and how each is read."""

import fnmatch
import re
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from neurosnap.errors import InvalidValueError, similar
from neurosnap.sources.conditions import (
    Condition,
    Heard,
    Signals,
    is_condition,
    parse_condition,
)
from neurosnap.sources.meaning import Reader, readers_of
from neurosnap.sources.message_fields import Term, parse_term


@dataclass(frozen=True)
class Wanted:
    """The sensors that are wanted, and how each is read.

    Args:
        patterns: Names, or patterns with ``*`` and ``?``; none: what a kind of data
            takes by itself.
        conditions: Of signals with numbers or words; these are read, too.
        time: The name of the column with the time; None for a first ``time``.
        bins: Parts that the range of another number is cut into; 0: none is.
        every: Seconds between the rows of messages; 0: as is usual for them.
        learned: The share of the data, from its beginning, that cuts are chosen by.
        cuts: Of other signals that are taken and are not on and off by themselves; none
            for one that is left out. None: they are not chosen yet.
        named: Only what is named is read, be it by conditions alone.
    """

    patterns: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    time: str | None = None
    bins: int = 4
    every: float = 0.0
    learned: float = 1.0
    cuts: Signals | None = None
    named: bool = False

    def takes(self, name: str, by_itself: bool = True, topic: str = "") -> bool:
        """Return whether a signal is read by itself, or as one of its topic."""
        if name in self.patterns:
            return True
        if self._of_values(name):
            return False
        if not self.patterns:
            return by_itself and not self.named
        return topic in self.patterns or any(
            fnmatch.fnmatchcase(name, pattern) for pattern in self.patterns
        )

    def looks_into(self, topic: str) -> bool:
        """Return whether fields of a topic's messages may be read; else its terms."""
        if not (self.patterns or self.named) or self._of_values(topic):
            return True
        names = {each.source for each in self.conditions} - {topic}
        heads = (re.split(r"[*?[]", name)[0] for name in (*self.patterns, *names))
        return any(head.startswith(topic) or topic.startswith(head) for head in heads)

    def parsed(self, names: Container[str] = ()) -> "Wanted":
        """Return the same with conditions among the patterns as what they are.

        Args:
            names: Of signals, which may look like conditions.
        """
        found = [
            each for each in self.patterns if each not in names and is_condition(each)
        ]
        return replace(
            self,
            patterns=tuple(each for each in self.patterns if each not in found),
            conditions=(*self.conditions, *map(parse_condition, found)),
            named=self.named or bool(self.patterns),
        )

    def terms(self) -> list[Term]:
        """Return the terms that are signals here.

        Raises:
            InvalidValueError: One takes no items.
        """
        names = [*self.patterns, *(each.source for each in self.conditions)]
        names += self.cuts or ()
        return [term for name in dict.fromkeys(names) if (term := parse_term(name))]

    def readers(
        self, name: str, by_itself: bool = True, topic: str = ""
    ) -> list[Reader]:
        """Return what reads a sensor of the data: nothing, or one for each name."""
        some: list[Condition | None] = [*self._of_values(name)]
        if self.takes(name, by_itself, topic):
            some += (self.cuts or {}).get(name, (None,))
        return readers_of(name, dict.fromkeys(some))

    def _of_values(self, name: str) -> list[Condition]:
        """Return the conditions to which it matters what a signal says."""
        some = [each for each in self.conditions if each.source == name]
        return [each for each in some if not isinstance(each, Heard)]

    def every_condition(self) -> dict[str, Condition]:
        """Return when sensors are on, as it was given or chosen, by their names."""
        chosen = chain(self.conditions, *(self.cuts or {}).values())
        return {each.name: each for each in chosen if each}

    def check(
        self, names: Sequence[str], where: str, *, messages: bool = False
    ) -> None:
        """Raise InvalidValueError for what is asked for and not there."""
        for condition in self.conditions:
            if isinstance(condition, Heard) and not messages:
                rule = "must be of messages (.mcap, or a live source)"
                raise InvalidValueError("heard within", rule, condition.name)
        missing = [
            pattern
            for pattern in self.patterns
            if pattern not in names and not fnmatch.filter(names, pattern)
        ]
        missing += {one.source for one in self.conditions}.difference(names)
        if missing:
            rule = f"must have this sensor{similar(missing[0], names)}"
            raise InvalidValueError(where, rule, missing[0])
