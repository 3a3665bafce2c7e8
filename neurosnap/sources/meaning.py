"""Converts a word or a number to a reading: on, off or unknown."""

import fnmatch
import math
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import msgspec

from neurosnap.errors import InvalidValueError, similar
from neurosnap.sensorium import WORDS

RULE = "must be 0 or 1, false or true, off or on, or nothing for unknown"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = frozenset((int, float))
_UNIT = r"(?:[^\s\d,<>.+-][^\s,<>]*)?"
_WHEN = re.compile(
    rf"(?P<name>.*?)\s*(?P<sign>[<>])\s*(?P<limit>{_NUMBER})\s*(?P<unit>{_UNIT})"
    rf"(?:\s*,\s*off\s*(?P<back>[<>])\s*(?P<release>{_NUMBER})\s*(?P<same>{_UNIT}))?",
    re.ASCII,
)
_EQUALS = re.compile(r"(?P<name>[^<>=]*?)\s*=\s*(?P<word>[^<>=]*[^<>=\s])\s*")
Bound: TypeAlias = tuple[float, int]
"""A number where a stretch begins or ends, and 0 if that is in it; else 1 or -1."""


class Comparison(NamedTuple):
    """Says when a sensor with a number is on: above a limit, or below it."""

    source: str
    """What the sensor is called in the data."""
    above: bool
    """On above the limit, or below it."""
    limit: float
    release: float | None = None
    """Off beyond this, on the other side; between the two, both included, as it was
    before. None if it is off wherever it is not on."""
    unit: str = ""
    """What both are in, as `plain_unit` has it; empty if that was not said."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source}{self._sign}{_plain(self.limit)}{self.unit}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        unit, back = f" {self.unit}" if self.unit else "", ""
        if self.release is not None:
            back = f", off {'<' if self.above else '>'} {self.release!r}{unit}"
        return f"{self._sign} {self.limit!r}{unit}{back}"

    @property
    def _sign(self) -> str:
        return ">" if self.above else "<"

    def span(self, *, on: bool) -> tuple[Bound, Bound]:
        """Return from where to where the number may be while it is on, or off."""
        sign = 1 if self.above else -1
        low, high = (-math.inf, 0), (sign * self.limit, 0)
        if on:
            low, high = (sign * self.limit, 1), (math.inf, 0)
            if self.release is not None:
                low = sign * self.release, 0
        if self.above:
            return low, high
        return (-high[0], -high[1]), (-low[0], -low[1])

    def is_on(self, value: float, before: bool | None) -> bool | None:
        """Return what a number says, or what was said before where it says nothing."""
        sign = 1 if self.above else -1
        if sign * value > sign * self.limit:
            return True
        if self.release is None or sign * value < sign * self.release:
            return False
        return before


class Choice(NamedTuple):
    """A word that a sensor is on at; it is off at any other."""

    source: str
    """What the sensor is called in the data."""
    word: str
    """In small letters."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source}={self.word}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return f"= {self.word}"


Condition: TypeAlias = Comparison | Choice
"""Says when a sensor is on, by a number or by a word."""


def _plain(number: float) -> str:
    """Return a number as it is written in a name."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def plain_unit(unit: str) -> str:
    """Return a unit with letters that look alike made the same.

    Examples:
        >>> plain_unit("\N{MICRO SIGN}m") == plain_unit("\N{GREEK SMALL LETTER MU}m")
        True
    """
    return unicodedata.normalize("NFC", unit).replace("\N{MICRO SIGN}", "\u03bc")


def parse_condition(text: str, name: str = "") -> Condition:
    """Parse a comparison, or a word such as ``mode = auto``.

    Args:
        text: It.
        name: As for `parse_comparison`.

    Raises:
        InvalidValueError: It is neither.
    """
    word = text.strip().removeprefix("=").strip()
    if name and word and text.lstrip().startswith("="):
        return Choice(name, word.casefold())
    match = _EQUALS.fullmatch(text.strip())
    if match is None or name or not match["name"]:
        return parse_comparison(text, name)
    return Choice(match["name"], match["word"].casefold())


def parse_comparison(text: str, name: str = "") -> Comparison:
    """Parse a comparison such as ``hall > 21 °C, off < 20``.

    Args:
        text: The comparison.
        name: What the sensor is called in the data; if empty, the text says it.

    Raises:
        InvalidValueError: It says nothing of the kind.

    Examples:
        >>> parse_comparison("hall > 21 °C, off < 20").name
        'hall>21°C'
    """
    match = _WHEN.fullmatch(text.strip())
    like = "" if name else "hall "
    rule = f'must be like "{like}> 21", "{like}> 21 °C, off < 20" or "{like}= warm"'
    if (
        match is None
        or match["back"] == match["sign"]
        or bool(match["name"]) == bool(name)
    ):
        raise InvalidValueError("when", rule, text)
    above, limit = match["sign"] == ">", float(match["limit"])
    release = None if match["release"] is None else float(match["release"])
    if release == limit:
        release = None
    if release is not None and (release > limit if above else release < limit):
        side = "below" if above else "above"
        rule = f"must let the sensor be off {side} where it is on"
        raise InvalidValueError("when", rule, text)
    unit = plain_unit(match["unit"])
    if match["same"] and plain_unit(match["same"]) != unit:
        raise InvalidValueError("when", "must have one unit", text)
    return Comparison(name or match["name"].strip(), above, limit, release, unit)


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
        cuts: Of other signals that are taken and are not on and off by themselves; see
            `neurosnap.sources.cuts`. None: they are not chosen yet.
    """

    patterns: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    time: str | None = None
    bins: int = 4
    every: float = 0.0
    learned: float = 1.0
    cuts: Mapping[str, tuple[Condition, ...]] | None = None

    def takes(self, name: str, by_itself: bool = True, topic: str = "") -> bool:
        """Return whether a signal is read by itself, or as one of its topic."""
        if any(name == condition.source for condition in self.conditions):
            return False
        if not self.patterns:
            return by_itself
        return topic in self.patterns or any(
            fnmatch.fnmatchcase(name, pattern) for pattern in self.patterns
        )

    def readers(
        self, name: str, by_itself: bool = True, topic: str = ""
    ) -> list["Reader"]:
        """Return what reads a sensor of the data: nothing, or one for each name."""
        conditions = [each for each in self.conditions if each.source == name]
        if self.takes(name, by_itself, topic):
            if self.cuts is None or name not in self.cuts:
                return [Reader(name)]
            conditions += self.cuts[name]
        return [Reader(condition.name, condition) for condition in conditions]

    def every_condition(self) -> Iterator[Condition]:
        """Yield the conditions that were given, and those that were chosen."""
        yield from self.conditions
        for chosen in (self.cuts or {}).values():
            yield from chosen

    def check(self, names: Sequence[str], where: str) -> None:
        """Raise InvalidValueError for a sensor that is asked for and not there."""
        missing = [
            pattern for pattern in self.patterns if not fnmatch.filter(names, pattern)
        ]
        missing += {one.source for one in self.conditions}.difference(names)
        if missing:
            rule = f"must have this sensor{similar(missing[0], names)}"
            raise InvalidValueError(where, rule, missing[0])


class Reader:
    """Reads the values of one sensor, one after the other.

    Args:
        name: Of the sensor.
        condition: None if values are words for on and off.
        words: What words mean, in small letters.
    """

    def __init__(
        self,
        name: str,
        condition: Condition | None = None,
        words: Mapping[str, bool | None] = WORDS,
    ) -> None:
        self.name = name
        self.condition = condition
        self._compares = isinstance(condition, Comparison)
        self._words = words
        self._before: bool | None = None

    def read(self, value: object) -> bool | None:
        """Return what a text, or another JSON value, says; None if it is unknown.

        Raises:
            ValueError: It says nothing; the text is the rule.
        """
        # For speed; what is no number is null as a text.
        if type(value) in _NUMBERS and self._compares and value == value:
            return self._compare(value)  # type: ignore[arg-type]
        text = value if isinstance(value, str) else as_text(value)
        word = text.strip().casefold()
        if self.condition is None:
            try:
                return self._words[word]
            except KeyError:
                raise ValueError(self._rule()) from None
        if WORDS.get(word, False) is None:
            self._before = None
            return None
        if isinstance(self.condition, Choice):
            return word == self.condition.word
        unit = self.condition.unit
        if unit:
            word = plain_unit(text).strip().removesuffix(unit).rstrip()
        try:
            return self._compare(float(word))
        except ValueError:
            what = f"a number, or one in {unit}" if unit else "a number"
            raise ValueError(f"must be {what}, or nothing for unknown") from None

    def _compare(self, number: float) -> bool | None:
        if math.isnan(number) or not isinstance(self.condition, Comparison):
            raise ValueError("must be a number")
        self._before = self.condition.is_on(number, self._before)
        return self._before

    def _rule(self) -> str:
        """Return what a word must be."""
        if self._words is WORDS:
            return RULE
        known = [word for word, on in self._words.items() if on is not None]
        return f"must be one of {', '.join(known)}"


def refused(where: str, name: str, error: ValueError, text: str) -> InvalidValueError:
    """Return the error of a value in data; a number is one that was not asked for.

    Args:
        where: Where the value stands.
        name: Of its sensor.
        error: From `Reader.read`.
        text: The value.
    """
    rule = str(error)
    if rule == RULE and is_number(text):
        rule += f' (or --when "{name} > NUMBER"; for a run, --set when=...)'
    return InvalidValueError(f"{where}: {name}", rule, text)


def is_number(text: str) -> bool:
    """Return whether a text is a number."""
    return re.fullmatch(_NUMBER, text.strip(), re.ASCII) is not None


def as_text(value: object) -> str:
    """Return a JSON value as the text it would be if it stood alone.

    Examples:
        >>> as_text(True), as_text(1.0), as_text(None)
        ('true', '1', 'null')
    """
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if type(value) is int:
        return str(value)  # of any size, which JSON is not
    return msgspec.json.encode(value).decode()
