"""What a message says: its fields, and what is counted over a list in it.

A message is what JSON or CDR decodes to: dicts, lists or arrays, and at the ends
booleans, numbers, texts or None. Each end is a *signal*, called by the way to it:
``/arm.joint[0].angle`` in a message of ``/arm``. A *term* is a signal, too:
``min(/scan.ranges[0:80])`` says one number of a stretch of a list.
"""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from neurosnap.errors import InvalidValueError

ITEMS = 64
"""Items of a list that are signals by themselves, at most."""
_DEEP = 16  # levels of fields
_MOMENTS = ({"sec", "nanosec"}, {"sec", "nsec"})
"""Fields of a time, which tells when it was and not what; CDR's are left out, too."""
_STEP = re.compile(r"\.([^.\[\]]+)|\[(\d+)\]")
_TERM = re.compile(
    r"(?P<function>min|max|mean|any|all|count)\("
    r"(?P<path>.+?)(?:\[(?P<start>\d*):(?P<stop>\d*)\])?\)"
)


class Term(NamedTuple):
    """Says one number, or yes or no, of a list in a message.

    What is not a number (NaN) is left out, as a range finder says it of no echo; of an
    empty list nothing is known.
    """

    name: str
    function: str
    """One of ``min``, ``max``, ``mean``; ``any``, ``all`` and ``count``: of items that
    are true, or not zero."""
    path: str
    """What the list is called."""
    start: int | None = None
    stop: int | None = None
    """Its items from here, and up to here; None: to its end."""

    def is_of(self, topic: str) -> bool:
        """Return whether the list is in the messages of a topic."""
        rest = self.path.removeprefix(topic)
        return rest != self.path and rest[:1] in ("", ".", "[")

    def of(self, topic: str, message: object) -> object:
        """Return what it says of a message; None if nothing is known. O(the list).

        Raises:
            InvalidValueError: The message has no such list, or not one of numbers.
        """
        rule = f"must be of a list of numbers at {self.path}"
        try:
            found = field(message, self.path.removeprefix(topic))
        except ValueError as error:
            raise InvalidValueError(self.name, str(error), topic) from None
        if not isinstance(found, list | np.ndarray):
            raise InvalidValueError(self.name, rule, str(found)[:40])
        try:
            items = np.asarray(found[self.start : self.stop], np.float64)
        except (TypeError, ValueError):
            raise InvalidValueError(self.name, rule, str(found[0])[:40]) from None
        if items.ndim != 1:
            raise InvalidValueError(self.name, rule, str(found[0])[:40])
        items = items[~np.isnan(items)]
        if not items.size:
            return None
        match self.function:
            case "any":
                return bool(items.any())
            case "all":
                return bool(items.all())
            case "count":
                return int(np.count_nonzero(items))
            case name:
                return float(getattr(items, name)())


def parse_term(text: str) -> Term | None:
    """Return the term that a signal's name is; None if it is none.

    Raises:
        InvalidValueError: It takes no items at all.
    """
    match = _TERM.fullmatch(text)
    if match is None:
        return None
    start, stop = (int(n) if (n := match[each]) else None for each in ("start", "stop"))
    if stop is not None and stop <= (start or 0):
        raise InvalidValueError("slice", "must end behind its beginning", text)
    return Term(text, match["function"], match["path"], start, stop)


def field(message: object, path: str) -> object:
    """Return what a message holds at ``.key`` and ``[0]`` after each other.

    Raises:
        ValueError: It has no such field; the text says which it has there.
    """
    here: Any = message
    at = 0
    while at < len(path):
        match = _STEP.match(path, at)
        if match is None:
            raise ValueError(f"must have the field {path}")
        key, place = match.groups()
        if key is not None and isinstance(here, dict) and key in here:
            here = here[key]
        elif place and isinstance(here, list | np.ndarray) and int(place) < len(here):
            here = here[int(place)]
        else:
            there = (
                ", ".join(sorted(map(str, here))[:ITEMS])
                if isinstance(here, dict)
                else ""
            )
            rest = f" (there are {there})" if there else ""
            raise ValueError(f"must have the field {path[: match.end()]}{rest}")
        at = match.end()
    return here


def fields(
    topic: str, message: object, terms: Sequence[Term] = (), into: bool = True
) -> list[tuple[str, object]]:
    """Return the signals of a message: names, and booleans, numbers, texts or None.

    Args:
        topic: What all their names begin with.
        message: It.
        terms: Of its lists, which are signals, too.
        into: Whether anything else is returned.

    Raises:
        InvalidValueError: A term is not of this message.
    """
    found: list[tuple[str, object]] = []
    if into:
        _flatten(topic, message, found, _DEEP)
    if terms:
        found.extend((term.name, term.of(topic, message)) for term in terms)
    return found


def _flatten(
    name: str, value: object, found: list[tuple[str, object]], deep: int
) -> None:
    if isinstance(value, dict):
        if deep and not (len(value) == 2 and value.keys() in _MOMENTS):
            for key, inner in value.items():
                _flatten(f"{name}.{key}", inner, found, deep - 1)
    elif isinstance(value, list | np.ndarray):
        if deep:
            items = value[:ITEMS]
            each = items if isinstance(items, list) else items.tolist()
            for place, inner in enumerate(each):
                _flatten(f"{name}[{place}]", inner, found, deep - 1)
    else:
        found.append((name, value))
