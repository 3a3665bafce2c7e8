"""Numbers of cells or workers, as those who start some of them give them."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from neurosnap.errors import InvalidValueError

_RANGE = re.compile(r"(\d{1,6})(?:-(\d{1,6}))?", re.ASCII)
"""A number or a range. No swarm has a million cells, and a list of them takes room."""
_OPEN_RANGE = re.compile(r"(\d{1,6})-", re.ASCII)


class Numbers(NamedTuple):
    """Some numbers, ascending, and perhaps all from another one on."""

    some: Sequence[int]
    """Those that were given one by one, or as a range."""
    rest: int | None = None
    """From where on all are meant; None: no others are."""

    def of(self, name: str, count: int) -> list[int]:
        """Return the numbers where there are so many, ascending.

        Args:
            name: What they are of: cells, workers.
            count: How many there are.

        Raises:
            InvalidValueError: One is of none that there is, or `rest` is.

        Example:
            >>> Numbers((1,), 3).of("cells", 6)
            [1, 3, 4, 5]
        """
        if not count:
            rule = f"must go with a swarm that has {name}"
            raise InvalidValueError(name, rule, self.some or self.rest)
        last = [*self.some[-1:], *([] if self.rest is None else [self.rest])][-1]
        if last >= count:
            rule = f"must be {name} of the swarm, 0 to {count - 1}"
            raise InvalidValueError(name, rule, last)
        open_range = () if self.rest is None else range(self.rest, count)
        return [*self.some, *open_range]


def parse_numbers(name: str, text: str) -> Numbers:
    """Return the numbers in ``0-3,20-``, whose last range may have no end.

    Args:
        name: What they are of, for the error.
        text: What was given.

    Raises:
        InvalidValueError: It holds something else, or a number twice.
    """
    closed, comma, last = text.rpartition(",")
    match = _OPEN_RANGE.fullmatch(last.strip())
    if match is None:
        return Numbers(parse_ranges(name, text))
    some, rest = parse_ranges(name, closed) if comma else [], int(match[1])
    if some[-1:] >= [rest]:
        raise InvalidValueError(name, "must name each once", text)
    return Numbers(some, rest)


def parse_ranges(name: str, text: str) -> list[int]:
    """Return the numbers in ``0-3,7``, ascending.

    Raises:
        InvalidValueError: It holds something else, or a number twice.
    """
    numbers: set[int] = set()
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        some = range(int(match[1]), int(match[2] or match[1]) + 1) if match else ()
        if not some:
            rule = "must be like 0-499 or 3,7,9-12, of at most six digits"
            raise InvalidValueError(name, rule, text)
        if not numbers.isdisjoint(some):
            raise InvalidValueError(name, "must name each once", text)
        numbers.update(some)
    return sorted(numbers)
