"""Converts a word or a number to a reading: on, off or unknown."""

import fnmatch
import math
import re
import struct
import unicodedata
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, similar
from neurosnap.sensorium import WORDS
from neurosnap.sources.message_fields import Term, parse_term

RULE = "must be 0 or 1, false or true, off or on, or nothing for unknown"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = frozenset((int, float))
_UNIT = r"(?:[^\s\d,<>.+-][^\s,<>]*)?"
_WHEN = re.compile(
    rf"(?P<name>.*?)\s*(?P<sign>[<>])\s*(?P<limit>{_NUMBER})\s*(?P<unit>{_UNIT})"
    rf"(?:\s*,\s*off\s*(?P<back>[<>])\s*(?P<release>{_NUMBER})\s*(?P<same>{_UNIT}))?",
    re.ASCII,
)
_CHANGE = re.compile(r"(?:(?P<name>.*\S)\s+)?(?P<kind>changes|rises|falls)")
_HEARD = re.compile(r"(?:(?P<name>.*\S)\s+)?heard\s+within\s+(?P<span>.+)")
_SPAN = re.compile(rf"(?P<span>{_NUMBER})\s*(?P<unit>ms|s|min|h|d)?")
_SECONDS = {"ms": 0.001, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}
_EQUALS = re.compile(r"(?P<name>[^<>=]*?)\s*=\s*(?P<word>[^<>=]*[^<>=\s])\s*")
_SHAPES = (_CHANGE, _HEARD, _EQUALS, _WHEN)
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


class Change(NamedTuple):
    """A sensor that is on where a signal says another value than before."""

    source: str
    """What the signal is called in the data."""
    kind: str
    """``changes``; or of a number ``rises`` or ``falls``."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source} {self.kind}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return self.kind

    def is_on(self, value: Any, before: Any) -> bool:  # noqa: ANN401
        """Return whether it is on at a number, behind another; or at a word."""
        if self.kind == "changes":
            return bool(value != before)
        return bool(value > before if self.kind == "rises" else value < before)


class Heard(NamedTuple):
    """A sensor that is on while messages come, whatever these say."""

    source: str
    """What the topic, or the signal, is called in the data."""
    within: float
    """Seconds after one in which the sensor is on."""

    @property
    def name(self) -> str:
        """What the binary sensor is called."""
        return f"{self.source} {self.text}"

    @property
    def text(self) -> str:
        """What `parse_condition` makes it of again, given its source."""
        return f"heard within {_plain(self.within)} s"


Condition: TypeAlias = Comparison | Choice | Change | Heard
"""Says when a sensor is on: by a number, a word, a change, or by any message."""
Signals: TypeAlias = Mapping[str, tuple[Condition | None, ...]]
"""When the sensors of each signal are on; None: as it says by itself."""


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
    """Parse a condition, as a user writes it.

    Args:
        text: ``hall > 21 °C, off < 20``, ``mode = auto``, ``level rises`` (or
            ``falls``, ``changes``), or ``/scan heard within 0.5 s``.
        name: What the signal is called in the data; if empty, the text says it.

    Raises:
        InvalidValueError: It says nothing of the kind.

    Examples:
        >>> parse_condition("hall > 21 °C, off < 20").name
        'hall>21°C'
        >>> parse_condition("heard within 500 ms", "/scan").name
        '/scan heard within 0.5 s'
    """
    said = text.strip()
    if name and said.startswith("=") and said != "=":  # any word
        return Choice(name, said[1:].strip().casefold())
    if match := _CHANGE.fullmatch(said):
        source = _one(name, match["name"], text)
        return Change(source, match["kind"])
    if match := _HEARD.fullmatch(said):
        within = parse_span(match["span"], "when")
        if not within:
            raise InvalidValueError("when", "must be within more than no time", text)
        return Heard(_one(name, match["name"], text), within)
    if match := _EQUALS.fullmatch(said):
        return Choice(_one(name, match["name"], text), match["word"].casefold())
    return _parsed_comparison(text, name)


def parse_span(text: str, name: str) -> float:
    """Return a time in seconds, as a user writes it: ``0.1``, ``100 ms``, ``2h``.

    Raises:
        InvalidValueError: It is none; `name` says which.
    """
    match = _SPAN.fullmatch(text.strip())
    seconds = float(match["span"]) * _SECONDS[match["unit"] or "s"] if match else -1
    if not 0 <= seconds < math.inf:
        rule = "must be a time such as 0.5, 500ms, 2 s, 10min, 1h or 1d"
        raise InvalidValueError(name, rule, text)
    return seconds


def is_condition(text: str) -> bool:
    """Return whether a text looks like a condition with the name of its signal.

    One that breaks a rule does, too, so that `parse_condition` says which.
    """
    shapes = (shape.fullmatch(text.strip()) for shape in _SHAPES)
    return any(match is not None and match["name"] for match in shapes)


def _one(name: str, said: str | None, text: str) -> str:
    """Return the name of a signal, which is given once."""
    if bool(name) == bool(said):
        raise InvalidValueError("when", _rule(name), text)
    return name or said or ""


def _rule(name: str) -> str:
    """Return what a condition must be."""
    like = "" if name else "hall "
    return (
        f'must be like "{like}> 21", "{like}> 21 °C, off < 20", "{like}= warm",'
        f' "{like}rises" (falls, changes) or "{like}heard within 5 s"'
    )


def _parsed_comparison(text: str, name: str) -> Comparison:
    match = _WHEN.fullmatch(text.strip())
    if match is None or match["back"] == match["sign"]:
        raise InvalidValueError("when", _rule(name), text)
    source = _one(name, match["name"].strip(), text)
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
    return Comparison(source, above, limit, release, unit)


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
    ) -> list["Reader"]:
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


class Reader:
    """Reads the values of one sensor, one after the other.

    Args:
        name: Of the sensor.
        condition: None if values are words for on and off.
        words: What words mean, in small letters.

    Attributes:
        number: That it compared last; NaN if that is unknown.
    """

    def __init__(
        self,
        name: str,
        condition: Condition | None = None,
        words: Mapping[str, bool | None] = WORDS,
    ) -> None:
        self.name = name
        self.condition = condition
        self._words = words
        self.number = math.nan
        self._before: bool | None = None
        self._said: str | float | None = None

    def read(self, value: object) -> bool | None:
        """Return what a text, or another JSON value, says; None if it is unknown.

        Raises:
            ValueError: It says nothing; the text is the rule.
        """
        condition = self.condition
        # For speed; what is no number is null as a text.
        if type(value) in _NUMBERS and value == value:
            if type(condition) is Comparison:
                return self._compare(condition, value)  # type: ignore[arg-type]
        elif type(value) is bool and condition is None and self._words is WORDS:
            return value
        text = value if isinstance(value, str) else as_text(value)
        word = text.strip().casefold()
        if condition is None:
            try:
                return self._words[word]
            except KeyError:
                raise ValueError(self._rule()) from None
        if isinstance(condition, Heard):
            return True
        if WORDS.get(word, False) is None:
            self._before = self._said = None
            self.number = math.nan
            return None
        match condition:
            case Choice():
                return word == condition.word
            case Change():
                said = word if condition.kind == "changes" else _number(word)
                before, self._said = self._said, said
                return None if before is None else condition.is_on(said, before)
        if condition.unit:
            word = plain_unit(text).strip().removesuffix(condition.unit).rstrip()
        return self._compare(condition, _number(word, condition.unit))

    def _compare(self, condition: Comparison, number: float) -> bool | None:
        self.number, self._before = number, condition.is_on(number, self._before)
        return self._before

    def _rule(self) -> str:
        """Return what a word must be."""
        if self._words is WORDS:
            return RULE
        known = [word for word, on in self._words.items() if on is not None]
        return f"must be one of {', '.join(known)}"


def readers_of(name: str, some: Iterable[Condition | None]) -> list[Reader]:
    """Return what reads a signal: one for each condition, as in `Signals`."""
    return [Reader(each.name if each else name, each) for each in some]


def _number(word: str, unit: str = "") -> float:
    """Return a number.

    Raises:
        ValueError: It is none.
    """
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if math.isnan(number):
        what = f"a number, or one in {unit}" if unit else "a number"
        raise ValueError(f"must be {what}, or nothing for unknown")
    return number


def compared(conditions: Iterable[Condition | None]) -> dict[int, int]:
    """Return of the sensors that compare a number which of the numbers that is.

    Args:
        conditions: When each sensor is on, in order.
    """
    places: dict[str, int] = {}
    return {
        sensor: places.setdefault(condition.source, len(places))
        for sensor, condition in enumerate(conditions)
        if isinstance(condition, Comparison)
    }


class Numbers:
    """The numbers that signals said last, packed as in `wire.Observation`.

    Args:
        readers: Of all sensors, in order.
    """

    def __init__(self, readers: Sequence[Reader] = ()) -> None:
        places = compared(reader.condition for reader in readers)
        first = {place: sensor for sensor, place in reversed(places.items())}
        self._each = [(first[place], readers[first[place]]) for place in sorted(first)]

    def packed(self, known: NDArray[np.bool_] | None) -> bytes:
        """Return them; ``(N,)`` tells which sensors are known, None that all are."""
        if not self._each:
            return b""
        said = [
            reader.number if known is None or known[sensor] else math.nan
            for sensor, reader in self._each
        ]
        with np.errstate(over="ignore"):  # what is too large is infinite, and not told
            return np.array(said, "<f4").tobytes()


def numbers_in(said: bytes, places: Mapping[int, int]) -> dict[int, float]:
    """Return the known numbers of an observation, by the sensors that compare them.

    Args:
        said: As `Numbers` packs them; others of a stranger's recording are left out.
        places: As `compared` returns them.
    """
    numbers = [number for (number,) in struct.iter_unpack("<f", said[: len(said) & ~3])]
    return {
        sensor: float(f"{numbers[place]:.6g}")  # float32 has no more
        for sensor, place in places.items()
        if place < len(numbers) and math.isfinite(numbers[place])
    }


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
